#pragma once

#include <absl/status/status.h>
#include <absl/strings/string_view.h>
#include <google/protobuf/message.h>

#include <set>
#include <string>

#include "core/scene/problem.h"
#include "core/scene/yaml_tree.h"

namespace adhesim {

// Turns YAML values into the fields of messages, driven by the messages' descriptors. Collects
// every mistake of writing: unknown and repeated names, wrong types and units, more than one member
// of a oneof. What the values may be is ValidateScene's business.
class MessageReader {
 public:
  // Both must outlive the reader.
  MessageReader(const YamlTree& tree, Problems* problems) : tree_(tree), problems_(problems) {}

  // Reads a map into a message.
  void ReadMessage(int node, const std::string& path, google::protobuf::Message* message);
  // Reads a value into one field; `at` is where to report that it is none (a value's key, or the
  // value).
  void ReadField(int node, int at, const std::string& path,
                 const google::protobuf::FieldDescriptor* field,
                 google::protobuf::Message* message);
  // Reads a value as one element: of a list at its end, or the single value of a field.
  void ReadElement(int node, int at, const std::string& path,
                   const google::protobuf::FieldDescriptor* field,
                   google::protobuf::Message* message);

  // True for a problem that only repeats what the reader has already reported: about a field that
  // could not be read, about a part of one, or about the lack of one.
  bool Repeats(const Problem& problem) const;

 private:
  void Report(const std::string& path, int at, std::string message);
  void ReportUnknown(int key, const std::string& path, const google::protobuf::Descriptor* type);

  const YamlTree& tree_;
  Problems* problems_;
  std::set<std::string> spoiled_;  // paths that could not be read
};

// Reads a text into a singular scalar field, or adds it to a repeated one.
absl::Status ReadScalar(absl::string_view text, const google::protobuf::FieldDescriptor* field,
                        google::protobuf::Message* message);

}  // namespace adhesim
