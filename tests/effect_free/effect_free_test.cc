#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>

namespace adhesim::test {
namespace {

constexpr int kSteps = 200;
// Not inlined: it is virtual, and called from another library.
constexpr const char* kStep =
    "adhesim::Pipeline::Step(std::span<adhesim::ToolInput const, 18446744073709551615ul>)";

struct Outcome {
  int exit_code = 0;
  std::map<std::string, std::string> values;  // what the probe printed, by the first word
  std::string errors;
};

// Tests run side by side, each in a process of its own.
std::string Scratch(const std::string& name) {
  return testing::TempDir() + "effect_probe_" + std::to_string(getpid()) + "." + name;
}

std::string TextOf(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

// Runs `probe` ("all", "srf", "tis") on a scene of this folder, under `prefix` if that is not
// empty. In the same environment every time, because the stack begins above it; with every symbol
// looked up at the start, because that takes longer where more symbols are; and without the
// allocator's cache, which would hand on what another thread's heap gave.
Outcome Probe(const std::string& prefix, const std::string& probe, const std::string& scene) {
  const std::string out = Scratch("out"), errors = out + ".errors";
  const std::string command =
      "env -i PATH=/usr/bin:/bin LD_BIND_NOW=1 GLIBC_TUNABLES=glibc.malloc.tcache_count=0 " +
      prefix + " " ADHESIM_PROBES + "/effect_probe_" + probe + " " ADHESIM_SOURCE_DIR +
      "/tests/effect_free/" + scene + ".yaml " + std::to_string(kSteps) + " > " + out + " 2> " +
      errors;
  Outcome outcome;
  outcome.exit_code = WEXITSTATUS(std::system(command.c_str()));
  std::istringstream lines(TextOf(out));
  for (std::string line; std::getline(lines, line);) {
    const auto space = line.find(' ');
    if (space != std::string::npos) outcome.values[line.substr(0, space)] = line.substr(space + 1);
  }
  outcome.errors = TextOf(errors);
  std::remove(out.c_str());
  std::remove(errors.c_str());
  return outcome;
}

// Instructions inside Pipeline::Step; 0 after a failure.
long long InstructionsOf(const std::string& probe, const std::string& scene) {
  const std::string file = Scratch("callgrind");
  const Outcome outcome = Probe("valgrind --tool=callgrind --callgrind-out-file=" + file +
                                    " --toggle-collect='" + kStep + "'",
                                probe, scene);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors
                                  << "\n(127: valgrind is missing; ./dev test installs it)";
  std::istringstream lines(TextOf(file));
  std::remove(file.c_str());
  long long instructions = 0;
  for (std::string word; lines >> word;) {
    if (word == "totals:") lines >> instructions;
  }
  return instructions;
}

std::set<std::string> EffectsOf(const Outcome& outcome) {
  std::istringstream words(outcome.values.at("effects"));
  std::set<std::string> effects;
  for (std::string effect; words >> effect;) effects.insert(effect);
  return effects;
}

class EffectFree : public testing::TestWithParam<std::pair<const char*, const char*>> {};

// Leaving effects out changes neither an instruction of the steps of a scene that does not call
// for them, nor a byte of its memory. 0, not a tolerance: see Probe() and the probe's threads.
TEST_P(EffectFree, SceneCostsTheSameInABuildWithoutTheEffectsThatItDoesNotName) {
  const auto [probe, scene] = GetParam();
  const Outcome full = Probe("", "all", scene), reduced = Probe("", probe, scene);
  ASSERT_EQ(full.exit_code, 0) << full.errors;
  ASSERT_EQ(reduced.exit_code, 0) << reduced.errors;
  EXPECT_LT(EffectsOf(reduced).size(), EffectsOf(full).size());
  EXPECT_GT(std::stoi(full.values.at("colliding")), 0) << "the scene is to have contacts";
  for (const char* value : {"allocations", "bytes", "hash"}) {
    EXPECT_EQ(full.values.at(value), reduced.values.at(value)) << value;
  }
  EXPECT_EQ(full.values.at("allocations_in_steps"), "0");
  EXPECT_EQ(reduced.values.at("allocations_in_steps"), "0");

  const long long with = InstructionsOf("all", scene), without = InstructionsOf(probe, scene);
  EXPECT_EQ(with, without);
  EXPECT_GT(without, 1000000) << "callgrind has not found " << kStep;
  RecordProperty("instructions", std::to_string(with));
  std::printf("%s: %lld instructions in %d steps with every effect, %lld with the scene's alone\n",
              scene, with, kSteps, without);
}

INSTANTIATE_TEST_SUITE_P(Scenes, EffectFree,
                         testing::Values(std::pair("srf", "surfaces"), std::pair("tis", "tissue")),
                         [](const auto& info) { return std::string(info.param.second); });

TEST(EffectFreeBuilds, LeaveEveryEffectOutOnce) {
  const std::set<std::string> all = EffectsOf(Probe("", "all", "surfaces"));
  const std::set<std::string> surfaces = EffectsOf(Probe("", "srf", "surfaces"));
  const std::set<std::string> tissue = EffectsOf(Probe("", "tis", "tissue"));
  for (const std::string& effect : all) {
    EXPECT_FALSE(surfaces.contains(effect) && tissue.contains(effect)) << effect;
  }
}

TEST(EffectFreeBuilds, RefuseAnEffectThatIsLeftOut) {
  const Outcome refused = Probe("", "srf", "tissue");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.errors.find("is not part of this build (ADHESIM_EFFECTS)"), std::string::npos)
      << refused.errors;
}

}  // namespace
}  // namespace adhesim::test
