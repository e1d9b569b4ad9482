#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/stop_signals.h"
#include "server/recording/paraview_export.h"
#include "server/recording/replay.h"

namespace adhesim {
namespace {

struct Arguments {
  std::string file;
  bool verify = false;
  int threads = 1;
  std::string pvd;
  bool json = false;
};

std::string HashText(std::uint64_t hash) { return absl::StrFormat("%016x", hash); }

Json DamageJson(const std::vector<McapDamage>& damage) {
  Json list = Json::array();
  for (const McapDamage& one : damage) {
    Json entry = {{"byte", one.offset}, {"what", one.what}};
    if (one.first_time && one.last_time) {
      entry["from_s"] = 1e-9 * static_cast<double>(*one.first_time);
      entry["to_s"] = 1e-9 * static_cast<double>(*one.last_time);
    }
    list.push_back(std::move(entry));
  }
  return list;
}

Json ResultJson(const Arguments& arguments, const ReplayResult& result) {
  Json json = {{"scene", result.about.scene_name},
               {"steps", result.steps},
               {"seconds", static_cast<double>(result.steps) * result.dt_s},
               {"frames", result.frames},
               {"threads", arguments.threads},
               {"recorded_by", {{"version", result.about.version}, {"build", result.about.build}}},
               {"seed", result.about.seed},
               {"truncated", result.truncated_at.has_value()}};
  if (result.truncated_at) json["truncated_at_byte"] = *result.truncated_at;
  if (result.writer_was_behind) json["writer_was_behind"] = true;
  json["damaged"] = DamageJson(result.damage);
  json["state_hash"] = HashText(result.final_hash);
  if (result.interrupted) json["interrupted"] = true;
  if (!arguments.verify) return json;
  json["verified_steps"] = result.verified;
  json["identical"] = !result.difference && !result.interrupted;
  if (result.difference) {
    json["first_difference"] = {{"index", result.difference->index},
                                {"step", result.difference->step},
                                {"time_s", result.difference->time_s},
                                {"actual", HashText(result.difference->actual)}};
    if (result.difference->expected) {
      json["first_difference"]["expected"] = HashText(*result.difference->expected);
    }
  }
  return json;
}

void PrintText(const Arguments& arguments, const ReplayResult& result) {
  std::cout << absl::StrFormat("%s: %d steps (%g s), %d frames, recorded by %s (%s); state %s\n",
                               Escaped(result.about.scene_name), result.steps,
                               static_cast<double>(result.steps) * result.dt_s, result.frames,
                               Escaped(result.about.version), Escaped(result.about.build),
                               HashText(result.final_hash));
  if (arguments.verify && !result.difference) {
    std::cout << absl::StrFormat("%d steps are identical, with %d threads\n", result.verified,
                                 arguments.threads);
  }
}

// What is wrong with the file, for people.
void PrintDamage(const std::string& file, const std::optional<std::uint64_t>& truncated_at,
                 const std::vector<McapDamage>& damage) {
  if (truncated_at) {
    std::cerr << absl::StrFormat("warning: %s: cut short at byte %d; used is what is whole\n", file,
                                 *truncated_at);
  }
  for (const McapDamage& one : damage) {
    std::string when;
    if (one.first_time && one.last_time) {
      when = absl::StrFormat(" (simulated time %.3f to %.3f s)", 1e-9 * *one.first_time,
                             1e-9 * *one.last_time);
    }
    std::cerr << absl::StrFormat("%s: damaged at byte %d: %s%s\n", file, one.offset, one.what,
                                 when);
  }
}

// What is wrong with the replay.
void PrintDifference(const Arguments& arguments, const ReplayResult& result) {
  if (result.writer_was_behind) {
    std::cerr << "warning: " << arguments.file
              << ": its writer was too far behind; the session went on after its end\n";
  }
  if (!result.difference) return;
  const ReplayDifference& difference = *result.difference;
  std::cerr << absl::StrFormat(
      "error: %s: the first difference is in step %d of the recording (step %d of the session, "
      "%g s): recorded hash %s, replayed %s\n",
      arguments.file, difference.index, difference.step, difference.time_s,
      difference.expected ? HashText(*difference.expected) : "missing",
      HashText(difference.actual));
}

int RunExport(const Arguments& arguments) {
  const absl::StatusOr<ExportResult> result =
      ExportParaView(arguments.file, arguments.pvd, StopOnSignals());
  if (!result.ok()) {
    std::cerr << "error: " << result.status().message() << "\n";
    return kExitBadInput;
  }
  if (arguments.json) {
    PrintJson({{"file", arguments.pvd},
               {"frames", result->frames},
               {"truncated", result->truncated_at.has_value()},
               {"damaged", DamageJson(result->damage)}});
  } else {
    std::cout << arguments.pvd << ": " << result->frames << " frames\n";
  }
  PrintDamage(arguments.file, result->truncated_at, result->damage);
  return result->interrupted ? kExitInterrupted : kExitOk;
}

int RunReplay(const Arguments& arguments) {
  ReplayOptions options;
  options.verify = arguments.verify;
  options.threads = arguments.threads;
  // While the scene is built, which may be long, they end the program as they always do.
  options.stop = StopOnSignals;
  const absl::StatusOr<ReplayResult> result = Replay(arguments.file, options);
  if (!result.ok()) {
    std::cerr << "error: " << result.status().message() << "\n";
    return kExitBadInput;
  }
  if (arguments.json) {
    PrintJson(ResultJson(arguments, *result));
  } else {
    PrintText(arguments, *result);
  }
  PrintDamage(arguments.file, result->truncated_at, result->damage);
  PrintDifference(arguments, *result);
  if (result->interrupted) return kExitInterrupted;
  // A file that was cut short is good as far as it goes; one that was changed is not.
  const bool wrong = result->difference || !result->damage.empty();
  return arguments.verify && wrong ? kExitCheckFailed : kExitOk;
}

}  // namespace

void AddReplayCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "replay", "Rebuilds what was recorded, from the recording alone, and steps it again");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("FILE", arguments->file, "Recording (.mcap)")->required();
  CLI::Option* verify =
      command->add_flag("--verify", arguments->verify,
                        "Compares the state's hash after every step; ends with 1 at the first "
                        "that differs");
  command
      ->add_option("--threads", arguments->threads,
                   "Threads that step; the result is the same for any number")
      ->check(CLI::Range(1, 64));
  command
      ->add_option("--export", arguments->pvd,
                   "Writes the recorded frames for ParaView instead: this file, and one for each "
                   "frame beside it")
      ->type_name("OUT.pvd")
      ->excludes(verify);
  command->add_flag("--json", arguments->json, "Prints one JSON object");
  command->callback(
      [=] { *exit_code = arguments->pvd.empty() ? RunReplay(*arguments) : RunExport(*arguments); });
}

}  // namespace adhesim
