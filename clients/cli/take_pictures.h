#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace adhesim {

// How pictures are taken.
struct PictureOptions {
  std::string browser;  // Chromium's program; empty: the one on PATH
  int width = 1280, height = 720;
  std::string colour_map = "none";
  std::string theme = "light";
  std::vector<std::string> hide;
  std::function<bool()> stop;  // may be empty
};

struct Picture {
  double at_s = 0;  // as asked for
  double time_s = 0;
  std::int64_t step = 0;  // of the frame that is shown
  std::string png;        // a file's bytes
};

// Whether pictures can be taken here. Errors: NotFound without a browser; FailedPrecondition when
// the program was built without the page.
absl::Status CanTakePictures(const std::string& browser);

// Shows instants of a recording in the page of a headless browser and hands each picture to `take`,
// in their order; an error of `take` ends it. Errors: the browser's, with what the page complained
// of.
absl::Status TakePictures(const std::string& recording, const std::vector<double>& at_s,
                          const PictureOptions& options,
                          const std::function<absl::Status(const Picture&)>& take);

}  // namespace adhesim
