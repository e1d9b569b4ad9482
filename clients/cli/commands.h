#pragma once

#include <CLI/CLI.hpp>

namespace adhesim {

// Exit codes of every command (contract).
enum ExitCode {
  kExitOk = 0,
  kExitCheckFailed = 1,
  kExitBadInput = 2,
  kExitCannotConnect = 3,
  kExitDeadlineMissed = 4,
  kExitInterrupted = 130,
};

// Each adds one subcommand (with its options and help) to `app`; running it stores an ExitCode in
// `*exit_code`.
void AddRunCommand(CLI::App& app, int* exit_code);
void AddRenderCommand(CLI::App& app, int* exit_code);
void AddPaperCommand(CLI::App& app, int* exit_code);
void AddStressCommand(CLI::App& app, int* exit_code);
void AddBenchCommand(CLI::App& app, int* exit_code);
void AddReplayCommand(CLI::App& app, int* exit_code);
void AddSceneCommand(CLI::App& app, int* exit_code);
void AddMeshCommand(CLI::App& app, int* exit_code);
void AddServeCommand(CLI::App& app, int* exit_code);
void AddOperateCommand(CLI::App& app, int* exit_code);
void AddWatchCommand(CLI::App& app, int* exit_code);

}  // namespace adhesim
