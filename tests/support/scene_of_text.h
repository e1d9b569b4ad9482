#pragma once

#include <google/protobuf/text_format.h>
#include <gtest/gtest.h>

#include <string>

#include "adhesim/v1/scene.pb.h"

namespace adhesim::test {

// A scene written as protobuf text.
inline v1::Scene SceneOfText(const std::string& text) {
  v1::Scene scene;
  EXPECT_TRUE(google::protobuf::TextFormat::ParseFromString(text, &scene));
  return scene;
}

}  // namespace adhesim::test
