#include "core/scene/validate.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/unknown_field_set.h>

#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "core/scene/did_you_mean.h"
#include "core/scene/field_options.h"
#include "core/scene/quantity.h"
#include "core/scene/scene_rules.h"

namespace adhesim {
namespace {

namespace pb = google::protobuf;
using Field = pb::FieldDescriptor;

// Names that references may use.
struct Names {
  std::vector<std::string> list;
  std::set<std::string> set;

  void Add(const std::string& name) {
    list.push_back(name);
    set.insert(name);
  }
};

// Checks the fields of every message against their options.
class FieldChecker {
 public:
  FieldChecker(const v1::Scene& scene, Problems* problems) : problems_(problems) {
    for (const v1::Body& body : scene.bodies()) bodies_.Add(body.name());
    for (const v1::Tool& tool : scene.tools()) tools_.Add(tool.name());
  }

  void Check(const pb::Message& message, const std::string& path) {
    const pb::Descriptor* type = message.GetDescriptor();
    if (!message.GetReflection()->GetUnknownFields(message).empty()) {
      Report(path, absl::StrCat(type->name(), " has fields that this version does not know"));
    }
    for (int i = 0; i < type->real_oneof_decl_count(); ++i)
      CheckOneof(message, type->oneof_decl(i), path);
    for (int i = 0; i < type->field_count(); ++i) {
      CheckField(message, type->field(i), JoinPath(path, type->field(i)->name()));
    }
  }

 private:
  void Report(const std::string& path, std::string message) {
    problems_->push_back({path, std::move(message)});
  }

  void CheckOneof(const pb::Message& message, const pb::OneofDescriptor* oneof,
                  const std::string& path) {
    if (!oneof->options().GetExtension(v1::one_required)) return;
    if (message.GetReflection()->HasOneof(message, oneof)) return;
    Report(JoinPath(path, oneof->name()),
           absl::StrCat(oneof->containing_type()->name(), " needs one of ",
                        absl::StrJoin(MemberNames(oneof), ", ")));
  }

  void CheckField(const pb::Message& message, const Field* field, const std::string& path) {
    if (!IsPresent(message, field)) {
      if (field->options().GetExtension(v1::required)) {
        Report(path, absl::StrCat("required, but missing", Permitted(field, "; permitted: ")));
      }
      return;
    }
    const pb::Reflection* reflection = message.GetReflection();
    if (!field->is_repeated()) {
      CheckValue(message, field, -1, path);
      return;
    }
    const int count = reflection->FieldSize(message, field);
    const int size = static_cast<int>(field->options().GetExtension(v1::size));
    if (size > 0 && count != size) {
      Report(path, absl::StrCat("has ", count, " elements; permitted: ", size));
      return;
    }
    std::set<std::string> seen;
    for (int i = 0; i < count && problems_->size() < kMostProblems; ++i) {
      const std::string element = IndexPath(path, i);
      CheckValue(message, field, i, element);
      if (field->options().GetExtension(v1::reference).empty()) continue;
      const std::string name = reflection->GetRepeatedString(message, field, i);
      if (!seen.insert(name).second)
        Report(element, absl::StrCat(Quoted(name), " is listed twice"));
    }
  }

  // One value: the element `index` of a list, or (-1) the only one.
  void CheckValue(const pb::Message& message, const Field* field, int index,
                  const std::string& path) {
    const pb::Reflection* reflection = message.GetReflection();
    const bool one = index < 0;
    switch (field->cpp_type()) {
      case Field::CPPTYPE_MESSAGE:
        Check(one ? reflection->GetMessage(message, field)
                  : reflection->GetRepeatedMessage(message, field, index),
              path);
        break;
      case Field::CPPTYPE_DOUBLE:
        CheckNumber(one ? reflection->GetDouble(message, field)
                        : reflection->GetRepeatedDouble(message, field, index),
                    field, path);
        break;
      case Field::CPPTYPE_UINT32:
        CheckNumber(reflection->GetUInt32(message, field), field, path);
        break;
      case Field::CPPTYPE_ENUM:
        CheckEnum(reflection->GetEnumValue(message, field), field, path);
        break;
      case Field::CPPTYPE_STRING:
        CheckText(one ? reflection->GetString(message, field)
                      : reflection->GetRepeatedString(message, field, index),
                  field, path);
        break;
      default:
        break;
    }
  }

  void CheckNumber(double value, const Field* field, const std::string& path) {
    if (!std::isfinite(value)) {
      Report(path, absl::StrCat("is ", NumberText(value), "; permitted: finite numbers"));
    } else if (!InRange(field->options().GetExtension(v1::range), value)) {
      Report(path, absl::StrCat("is ", NumberText(value), Permitted(field, "; permitted: ")));
    }
  }

  void CheckEnum(int value, const Field* field, const std::string& path) {
    if (field->enum_type()->FindValueByNumber(value) != nullptr) return;
    Report(path, absl::StrCat("unknown value ", value, "; permitted: ",
                              absl::StrJoin(ShortNames(field->enum_type()), ", ")));
  }

  void CheckText(const std::string& text, const Field* field, const std::string& path) {
    if (text.empty() && field->options().GetExtension(v1::required))
      Report(path, "must not be empty");
    const std::string& reference = field->options().GetExtension(v1::reference);
    if (reference.empty()) return;
    const Names& names = reference == "tool" ? tools_ : bodies_;
    if (names.set.contains(text)) return;
    Report(path, absl::StrCat("there is no ", reference, " named ", Quoted(text),
                              DidYouMean(text, names.list)));
  }

  static std::string Permitted(const Field* field, absl::string_view before) {
    const std::string range = RangeText(field->options().GetExtension(v1::range));
    return range.empty() ? "" : absl::StrCat(before, range);
  }

  Problems* problems_;
  Names bodies_;
  Names tools_;
};

}  // namespace

Problems ValidateScene(const v1::Scene& scene) {
  Problems problems;
  FieldChecker(scene, &problems).Check(scene, "");
  CheckSceneRules(scene, &problems);
  if (problems.size() > kMostProblems) problems.resize(kMostProblems);
  return problems;
}

}  // namespace adhesim
