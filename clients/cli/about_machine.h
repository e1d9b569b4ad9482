#pragma once

#include <string>

namespace adhesim {

// What a report says about where it was made: enough to compare times, and no name of the machine
// or its owner.
struct AboutMachine {
  std::string processor;  // its model
  int cores = 0;          // that this process may use
  double load = 0;        // mean number of running tasks in the last minute
  std::string version, build, commit;
  std::string date;  // UTC, as 2026-01-31 12:00
};
AboutMachine DescribeMachine();

// The same, on one line.
std::string MachineText(const AboutMachine& machine);

}  // namespace adhesim
