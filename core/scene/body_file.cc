#include "core/scene/body_file.h"

#include <absl/strings/str_cat.h>

namespace adhesim {

std::string* MutableFileOf(v1::Body* body) {
  switch (body->shape_case()) {
    case v1::Body::kMesh:
      return body->mutable_mesh()->mutable_file();
    case v1::Body::kLabelMap:
      return body->mutable_label_map()->mutable_file();
    case v1::Body::kTetMesh:
      return body->mutable_tet_mesh()->mutable_file();
    default:
      return nullptr;
  }
}

const std::string* FileOf(const v1::Body& body) {
  switch (body.shape_case()) {
    case v1::Body::kMesh:
      return &body.mesh().file();
    case v1::Body::kLabelMap:
      return &body.label_map().file();
    case v1::Body::kTetMesh:
      return &body.tet_mesh().file();
    default:
      return nullptr;
  }
}

std::string ShapePath(const v1::Body& body, const std::string& path) {
  const auto* shape = body.GetDescriptor()->FindOneofByName("shape");
  const auto* field = body.GetReflection()->GetOneofFieldDescriptor(body, shape);
  if (field == nullptr) return path;
  return absl::StrCat(path, ".", field->name(), FileOf(body) != nullptr ? ".file" : "");
}

}  // namespace adhesim
