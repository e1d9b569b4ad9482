#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/cli/commands.h"
#include "clients/cli/load_scene.h"
#include "clients/cli/output.h"
#include "clients/cli/picture_source.h"
#include "clients/cli/stop_signals.h"
#include "clients/cli/take_pictures.h"
#include "clients/cli/validators.h"
#include "server/recording/temporary_directory.h"

namespace adhesim {
namespace {

namespace fs = std::filesystem;

// Half of the time between a recording's frames, and some: a picture is of the nearest.
constexpr double kNearS = 0.02;

struct Arguments {
  std::string source;
  std::vector<double> at_s;
  std::string out;
  std::string size = "1280x720";
  std::string colour_map = "none";
  std::string theme = "light";
  std::vector<std::string> hide;
  std::string browser;
  std::vector<std::string> settings;
  bool json = false;
};

struct Size {
  int width = 0, height = 0;
};

// "640x480"; empty unless both are from 64 to 8192.
std::optional<Size> ParseSize(const std::string& text) {
  Size size;
  const char* end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, size.width);
  if (width.ec != std::errc() || width.ptr == end || *width.ptr != 'x') return std::nullopt;
  const auto height = std::from_chars(width.ptr + 1, end, size.height);
  if (height.ec != std::errc() || height.ptr != end) return std::nullopt;
  const auto permitted = [](int pixels) { return pixels >= 64 && pixels <= 8192; };
  if (!permitted(size.width) || !permitted(size.height)) return std::nullopt;
  return size;
}

ExitCode Fail(const absl::Status& status) {
  if (absl::IsCancelled(status)) return kExitInterrupted;
  std::cerr << "error: " << status.message() << "\n";
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kOutOfRange:
      return kExitBadInput;
    case absl::StatusCode::kUnavailable:
      return kExitCannotConnect;
    default:
      return kExitCheckFailed;
  }
}

// A directory that can be written to, made if need be.
absl::Status MakeOutputDirectory(const std::string& directory) {
  std::error_code error;
  fs::create_directories(directory, error);
  if (!error && access(directory.c_str(), W_OK | X_OK) == 0) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("--out ", directory, ": cannot be written to"));
}

// The recording of what is to be seen: the one that was asked for, or a new one in `directory`.
absl::StatusOr<std::string> Prepare(const Arguments& arguments, const std::string& directory) {
  if (!IsMcap(arguments.source)) {
    const std::string file = absl::StrCat(directory, "/instants.mcap");
    const absl::Status recorded =
        RecordInstants(arguments.source, arguments.settings, arguments.at_s, file, StopRequested);
    if (!recorded.ok()) return recorded;
    return file;
  }
  const absl::StatusOr<double> end_s = LastFrameTime(arguments.source);
  if (!end_s.ok()) return end_s.status();
  const double latest_s = *std::max_element(arguments.at_s.begin(), arguments.at_s.end());
  if (latest_s > *end_s + kNearS) {
    return absl::OutOfRangeError(
        absl::StrFormat("--at %g: %s ends at %.3f s", latest_s, arguments.source, *end_s));
  }
  return fs::canonical(arguments.source).string();
}

// Writes a picture; nothing is left of it otherwise.
absl::Status WritePicture(const Picture& picture, const std::string& path) {
  std::ofstream file(path, std::ios::binary);
  file << picture.png;
  file.close();
  if (file) return absl::OkStatus();
  std::error_code ignored;
  fs::remove(path, ignored);
  return absl::InvalidArgumentError(absl::StrCat("cannot write ", path));
}

absl::Status WritePictures(const Arguments& arguments, Size size, const std::string& recording) {
  const PictureOptions options{.browser = arguments.browser,
                               .width = size.width,
                               .height = size.height,
                               .colour_map = arguments.colour_map,
                               .theme = arguments.theme,
                               .hide = arguments.hide,
                               .stop = StopRequested};
  Json pictures = Json::array();
  const absl::Status status =
      TakePictures(recording, arguments.at_s, options, [&](const Picture& picture) {
        const std::string name = absl::StrFormat(
            "%s-t%.3fs.png", fs::path(arguments.source).stem().string(), picture.at_s);
        const std::string path = (fs::path(arguments.out) / name).string();
        const absl::Status written = WritePicture(picture, path);
        if (!written.ok()) return written;
        if (!arguments.json) std::cout << path << std::endl;
        pictures.push_back({{"path", path}, {"step", picture.step}, {"time_s", picture.time_s}});
        return written;
      });
  if (status.ok() && arguments.json) PrintJson({{"pictures", pictures}});
  return status;
}

ExitCode Render(Arguments arguments) {
  const std::optional<Size> size = ParseSize(arguments.size);
  if (!size) {
    std::cerr << "error: --size " << arguments.size
              << " is not permitted (WIDTHxHEIGHT, each from 64 to 8192)\n";
    return kExitBadInput;
  }
  // Names show milliseconds: what they cannot tell apart is one picture.
  for (double& at_s : arguments.at_s) at_s = std::round(at_s * 1e3) * 1e-3;
  std::sort(arguments.at_s.begin(), arguments.at_s.end());
  arguments.at_s.erase(std::unique(arguments.at_s.begin(), arguments.at_s.end()),
                       arguments.at_s.end());
  StopOnSignals();
  // Before the work, which may be long.
  for (const absl::Status& status :
       {CanTakePictures(arguments.browser), MakeOutputDirectory(arguments.out)}) {
    if (!status.ok()) return Fail(status);
  }
  const absl::StatusOr<std::unique_ptr<TemporaryDirectory>> directory = TemporaryDirectory::Make();
  if (!directory.ok()) return Fail(directory.status());
  const absl::StatusOr<std::string> recording = Prepare(arguments, (*directory)->path());
  if (!recording.ok()) return Fail(recording.status());
  const absl::Status status = WritePictures(arguments, *size, *recording);
  return status.ok() ? kExitOk : Fail(status);
}

}  // namespace

void AddRenderCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "render", "Pictures of chosen instants, through a browser without a display");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("SOURCE", arguments->source, "Scene file, or recording (.mcap)")
      ->required()
      ->check(CLI::ExistingFile);
  command
      ->add_option("--at", arguments->at_s,
                   "Simulated times, s; of a recording the nearest frames are shown")
      ->required()
      ->type_name("T...")
      ->check(Between(0.0, 1e6));
  command
      ->add_option("--out", arguments->out,
                   "Directory for the pictures, which are named NAME-tT.TTTs.png")
      ->required()
      ->type_name("DIR");
  command->add_option("--size", arguments->size, "Pixels")
      ->type_name("WIDTHxHEIGHT")
      ->capture_default_str();
  command->add_option("--colour-map", arguments->colour_map, "What the tissue's colour shows")
      ->check(CLI::IsMember({"none", "displacement", "contact-force", "strain-energy", "zone"}))
      ->capture_default_str();
  command->add_option("--hide", arguments->hide, "What is left out")
      ->type_name("WHAT...")
      ->check(CLI::IsMember({"contacts", "zones", "forces", "ground"}));
  command->add_option("--theme", arguments->theme, "Background")
      ->check(CLI::IsMember({"light", "dark"}))
      ->capture_default_str();
  AddSettingsOption(command, &arguments->settings);
  command->add_option("--browser", arguments->browser,
                      "Chromium's program (default: the one on PATH)");
  command->add_flag("--json", arguments->json,
                    "Prints one JSON object: path, step and time of each");
  command->callback([arguments, exit_code] { *exit_code = Render(*arguments); });
}

}  // namespace adhesim
