#include "clients/cli/about_machine.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/strip.h>
#include <absl/time/clock.h>
#include <absl/time/time.h>
#include <sched.h>
#include <stdlib.h>

#include <fstream>

#include "build_commit.h"
#include "clients/cli/record_run.h"

namespace adhesim {
namespace {

std::string ProcessorModel() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (!absl::StartsWith(line, "model name")) continue;
    const std::size_t colon = line.find(':');
    if (colon != std::string::npos) {
      return std::string(absl::StripAsciiWhitespace(line.substr(colon + 1)));
    }
  }
  return "unknown processor";
}

int Cores() {
  cpu_set_t permitted;
  CPU_ZERO(&permitted);
  return sched_getaffinity(0, sizeof(permitted), &permitted) == 0 ? CPU_COUNT(&permitted) : 1;
}

}  // namespace

AboutMachine DescribeMachine() {
  AboutMachine about;
  about.processor = ProcessorModel();
  about.cores = Cores();
  if (getloadavg(&about.load, 1) != 1) about.load = 0;
  about.version = ADHESIM_VERSION;
  about.build = BuildText();
  about.commit = kBuildCommit;
  about.date = absl::FormatTime("%Y-%m-%d %H:%M", absl::Now(), absl::UTCTimeZone());
  return about;
}

std::string MachineText(const AboutMachine& machine) {
  return absl::StrFormat("%s UTC; adhesim %s, commit %s; %s; %s, %d cores, load %.2f at the start",
                         machine.date, machine.version, machine.commit, machine.build,
                         machine.processor, machine.cores, machine.load);
}

}  // namespace adhesim
