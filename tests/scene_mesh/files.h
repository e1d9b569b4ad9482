#pragma once

#include <map>
#include <string>

#include "core/model/geometry.h"

namespace adhesim {

// A file in a folder of its own, removed with it.
class TemporaryFile {
 public:
  TemporaryFile(const std::string& name, const std::string& bytes);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  const std::string& path() const { return path_; }
  const std::string& directory() const { return directory_; }

 private:
  std::string directory_;
  std::string path_;
};

std::string WriteObj(const TriangleMesh& mesh);

// The bytes of a mesh (coordinates that single precision holds) in every format and encoding, by
// file name.
std::map<std::string, std::string> InEveryFormat(const TriangleMesh& mesh);

}  // namespace adhesim
