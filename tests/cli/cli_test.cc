#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

namespace adhesim {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using Json = nlohmann::json;

struct Outcome {
  int exit_code = -1;
  std::string out;
  std::string err;
};

std::string TempFile(const std::string& name) {
  // Tests may run at the same time in processes of their own.
  return ::testing::TempDir() + "cli_test_" + std::to_string(getpid()) + "_" + name;
}

std::string ReadAll(const std::string& path) {
  std::ifstream stream(path);
  return std::string((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
}

Outcome CallProgram(const std::string& program, const std::string& arguments) {
  const std::string out = TempFile("out"), err = TempFile("err");
  const std::string command = program + " " + arguments + " >" + out + " 2>" + err + " </dev/null";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, ReadAll(out), ReadAll(err)};
}

Outcome Adhesim(const std::string& arguments) { return CallProgram(ADHESIM_PROGRAM, arguments); }

std::string Scene(const std::string& text) {
  const std::string path = TempFile("scene.yaml");
  std::ofstream(path) << text;
  return path;
}

// A ball that falls, and one beside it.
std::string FallingScene() {
  return Scene(
      "name: falling\nbodies:\n"
      "  - {name: a, icosphere: {radius_m: 10 mm}, mass_kg: 1 g}\n"
      "  - {name: b, icosphere: {radius_m: 10 mm}, mass_kg: 1 g, position_m: [1, 0, 0]}\n"
      "effects:\n"
      "  - shape_memory: {stiffness_n_m: 1}\n"
      "  - volume_preservation: {}\n"
      "  - uniform_gravity: {}\n");
}

TEST(Cli, HelpsEverywhere) {
  for (const char* command :
       {"", "run", "scene", "scene check", "scene show", "scene schema", "scene explain",
        "scene export", "mesh", "mesh info", "mesh convert"}) {
    const Outcome outcome = Adhesim(std::string(command) + " --help");
    EXPECT_EQ(outcome.exit_code, 0) << command;
    EXPECT_THAT(outcome.out, HasSubstr("Usage: ")) << command;
  }
  EXPECT_THAT(Adhesim("--version").out, StartsWith("adhesim "));
}

TEST(Cli, EndsWithTwoOnBadUsage) {
  const std::string scene = FallingScene();
  for (const std::string& arguments :
       {std::string(), std::string("run"), std::string("scene"), "run " + scene + " --threads 0",
        "run " + scene + " --nonsense", "run " + scene + " --steps 0",
        "run " + scene + " --seconds -1", "run " + scene + " --steps 5 --seconds 1",
        "run " + scene + " --steps many", "run " + scene + " --steps 5 --measure-from 1",
        "run " + scene + " --rate 0", "run " + scene + " --set rate",
        "run " + scene + " --set rate=5", "run " + scene + " --set bodies[0].mass_kg=-1"}) {
    const Outcome outcome = Adhesim(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr("error: ")) << arguments;
    EXPECT_EQ(outcome.out, "") << arguments;
  }
}

TEST(Cli, SuggestsTheCommandMeant) {
  EXPECT_THAT(Adhesim("rnu x").err, HasSubstr("did you mean 'run'?"));
  EXPECT_THAT(Adhesim("scene chek x").err, HasSubstr("did you mean 'check'?"));
  EXPECT_THAT(Adhesim("run x --jsn=f").err,
              HasSubstr("did you mean '--json'?)\nSee adhesim run --help"));
}

TEST(Cli, ReportsEveryMistakeOfAScene) {
  const std::string path =
      Scene("bodies:\n  - name: a\n    mesh: {file: absent.obj}\n    mass_kg: -1\nrate: 5\n");
  for (const char* command : {"scene check ", "run ", "scene explain "}) {
    const Outcome outcome = Adhesim(command + path);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.out, "");
    EXPECT_THAT(outcome.err,
                HasSubstr(path + ":3:18: error: bodies[0].mesh.file: no such file: 'absent.obj'"));
    EXPECT_THAT(outcome.err, HasSubstr(path + ":4:14: error: bodies[0].mass_kg: is -1"));
    EXPECT_THAT(outcome.err,
                HasSubstr(path + ":5:1: error: rate: unknown field 'rate' in Scene (did you mean"));
  }
  EXPECT_EQ(Adhesim("run no_such_scene.yaml").exit_code, 2);
}

TEST(Cli, ChecksSeveralScenes) {
  const std::string good = FallingScene();
  const Outcome outcome = Adhesim("scene check " + good + " no_such_scene.yaml");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.out, HasSubstr(good + ": ok, 2 bodies, 84 particles"));
  EXPECT_THAT(outcome.err, HasSubstr("no_such_scene.yaml:1:1: error: no such file"));
  EXPECT_EQ(Adhesim("scene check " + good).exit_code, 0);
}

TEST(Cli, ChecksWhatOnlyCompilingFinds) {
  const std::string scene = FallingScene();
  std::ofstream(scene, std::ios::app)
      << "  - attraction: {point_m: [0, 0, 0], acceleration_m_s2: 1}\nsleep: {speed_m_s: 0.001}\n";
  const Outcome outcome = Adhesim("scene check " + scene);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.out, "");
  EXPECT_THAT(outcome.err, HasSubstr(":5: error: effects[3].attraction"));
}

// A file is refused for a rung that its scene does not have, with its line; what is changed for one
// run does without what was measured.
TEST(Cli, RefusesErrorsOfRungsThatASceneDoesNotHave) {
  const std::string scene = Scene(
      "rate_hz: 100\n"
      "rungs:\n"
      "  iterations: {position_error: 0.001}\n"
      "  stiffness: {position_error: 0.002}\n"
      "bodies: [{name: a, block: {size_m: [0.1, 0.1, 0.1]}, tetrahedra: {cells: 2}, mass_kg: 1}]\n"
      "effects: [elasticity: {young_modulus_pa: 1e4}]\n");
  EXPECT_EQ(Adhesim("scene check " + scene).exit_code, 0);
  const std::string newton = " --set integration.integrator=newton";
  EXPECT_EQ(Adhesim("run " + scene + " --steps 1" + newton).exit_code, 0);
  std::ofstream(scene, std::ios::app) << "integration: {integrator: newton}\n";
  for (const std::string command : {"scene check ", "scene explain ", "run --steps 1 "}) {
    const Outcome outcome = Adhesim(command + scene);
    EXPECT_EQ(outcome.exit_code, 2) << command;
    EXPECT_THAT(outcome.err,
                HasSubstr(":4:3: error: rungs.stiffness: the scene has no such rung to "
                          "give up; permitted: iterations"))
        << command;
  }
}

TEST(Cli, ShowsASceneThatReadsBackTheSame) {
  const Outcome shown = Adhesim("scene show " + FallingScene());
  EXPECT_EQ(shown.exit_code, 0);
  EXPECT_THAT(shown.out, HasSubstr("rate_hz: 1000\n"));
  const Outcome again = Adhesim("scene show " + Scene(shown.out));
  EXPECT_EQ(again.out, shown.out);
}

TEST(Cli, SaysWhatAMeshIs) {
  const std::string path = TempFile("tetrahedron.obj");
  std::ofstream(path) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  const Outcome outcome = Adhesim("mesh info " + path + " --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["vertices"], 4);
  EXPECT_EQ(json["closed"], true);
  EXPECT_NEAR(json["volume"].get<double>(), 1.0 / 6, 1e-15);  // a few roundings of numbers near 1
  EXPECT_THAT(Adhesim("mesh info " + path).out, HasSubstr("closed, manifold, oriented"));
  EXPECT_EQ(Adhesim("mesh info no_such_mesh.obj").exit_code, 2);
}

TEST(Cli, WritesPmlThatIsTheSameMeshAndTheSameBodies) {
  const std::string mesh = TempFile("tetrahedron.obj"), pml = TempFile("out.pml");
  std::ofstream(mesh) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  ASSERT_EQ(Adhesim("mesh convert " + mesh + " " + pml).exit_code, 0);
  Json before = Json::parse(Adhesim("mesh info --json " + mesh).out);
  Json after = Json::parse(Adhesim("mesh info --json " + pml).out);
  before.erase("file");
  after.erase("file");
  EXPECT_EQ(after, before);

  const Outcome exported = Adhesim("scene export " + FallingScene() + " --pml " + pml);
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  const Json ball = Json::parse(Adhesim("mesh info --component b --json " + pml).out);
  EXPECT_EQ(ball["vertices"], 42);
  EXPECT_GT(ball["box_min"][0].get<double>(), 0.9);  // body b stands at x = 1
  const std::string again =
      Scene("bodies:\n  - {name: a, mesh: {file: " + pml + ", component: b}, mass_kg: 1}\n");
  EXPECT_THAT(Adhesim("scene check " + again).out, HasSubstr("1 body, 42 particles"));

  EXPECT_EQ(Adhesim("mesh convert " + mesh + " " + mesh).exit_code, 2);
  EXPECT_EQ(Adhesim("mesh convert " + mesh + " /nonexistent/out.pml").exit_code, 2);
  const Outcome unknown = Adhesim("mesh info --component c " + pml);
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("is named 'c'; there are: 'a', 'b'"));
}

TEST(Cli, PrintsTheSchema) {
  const Outcome outcome = Adhesim("scene schema");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_TRUE(Json::parse(outcome.out).contains("$defs"));
}

TEST(Cli, RunReportsTheFieldsOfTheContract) {
  const Outcome outcome =
      Adhesim("run " + FallingScene() + " --steps 200 --measure-from 0.1 --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json report = Json::parse(outcome.out);
  EXPECT_EQ(report["scene"], "falling");
  EXPECT_EQ(report["steps"], 200);
  EXPECT_EQ(report["dt_s"], 0.001);
  EXPECT_EQ(report["bodies"], 2);
  EXPECT_EQ(report["particles"], 84);
  EXPECT_EQ(report["triangles"], 160);
  EXPECT_EQ(report["finite"], true);
  EXPECT_EQ(report["sleeping"], false);
  for (const char* field : {"threads", "simd", "realtime_factor", "stages", "volume_error_max",
                            "state_hash", "max_depth_m", "vertices_inside_max"}) {
    EXPECT_TRUE(report.contains(field)) << field;
  }
  for (const char* times : {"wall_ms_per_step", "cpu_ms_per_step"}) {
    for (const char* figure : {"min", "median", "p99", "max"})
      EXPECT_GE(report[times][figure], 0) << figure;
  }
  EXPECT_EQ(report["effects"], Json({"shape_memory", "volume_preservation", "uniform_gravity"}));
  // The scene has no tools, no adhesive and no deadlines.
  for (const char* field :
       {"tools", "colliding_particles", "zones", "deadline_misses", "tetrahedra"}) {
    EXPECT_FALSE(report.contains(field)) << field;
  }
  // 2 g fall 0.2 s at 9.81 m/s^2: the work of gravity is m g^2 t^2 / 2, up to the first order in
  // the step of 1 ms.
  const Json& energy = report["energy"];
  EXPECT_NEAR(energy["external_work_j"].get<double>(), 0.002 * 9.81 * 9.81 * 0.04 / 2,
              0.01 * 0.00385);
  for (const char* field : {"initial_j", "final_j", "reference_j", "tool_work_j", "captured_j",
                            "viscous_j", "rotation_j", "numerical_j", "correction_j"}) {
    EXPECT_TRUE(energy.contains(field)) << field;
  }
  EXPECT_LE(energy["identity_error"], 1e-9);  // the contract's own bound
  EXPECT_LE(report["momentum_error"]["linear"], 1e-10);
  EXPECT_LE(report["momentum_error"]["angular"], 1e-10);
}

TEST(Cli, RunCountsTheStepsThatTheSolverLeftUnfinished) {
  const std::string scene = TempFile("tissue.yaml");
  std::ofstream(scene)
      << "bodies:\n  - {name: b, block: {size_m: [0.1, 0.1, 0.1]}, tetrahedra: {cells: 2}, "
         "mass_kg: 1,\n     fixed: [half_space: {point_m: [0, 0, 0], normal: [0, 0, 1]}]}\n"
         "effects:\n  - elasticity: {young_modulus_pa: 5000}\n  - uniform_gravity: {}\n";
  const auto run = [&](const std::string& options) {
    const Outcome outcome = Adhesim("run " + scene + " --steps 20 " + options);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.out;
  };
  EXPECT_EQ(Json::parse(run("--json"))["unconverged_steps"], 0);
  const std::string one = "--set integration.max_iterations=1 ";
  const Json report = Json::parse(run(one + "--json"));
  // The first steps; the last change of velocity serves the later ones as a start.
  const int unfinished = report["unconverged_steps"];
  EXPECT_GT(unfinished, 0);
  EXPECT_EQ(report["report"], Json({"not_converged"}));
  EXPECT_NE(run(one).find("stopped at max_iterations in " + std::to_string(unfinished) + " steps"),
            std::string::npos);
}

TEST(Cli, RunGivesTheSameStateEachTimeAndAnotherWithAnotherSetting) {
  const std::string run = "run " + FallingScene() + " --steps 50 --json ";
  const auto hash = [](const Outcome& outcome) {
    return Json::parse(outcome.out)["state_hash"].get<std::string>();
  };
  const std::string first = hash(Adhesim(run));
  EXPECT_EQ(hash(Adhesim(run)), first);
  EXPECT_EQ(hash(Adhesim(run + "--threads 2")), first);
  EXPECT_NE(hash(Adhesim(run + "--set bodies[0].velocity_m_s='[1 mm/s, 0, 0]'")), first);
}

TEST(Cli, RunTakesRateAndSettings) {
  const Outcome outcome =
      Adhesim("run " + FallingScene() +
              " --seconds 0.1 --rate 500 --set effects[0].shape_memory.stiffness_n_m=2 --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(Json::parse(outcome.out)["steps"], 50);
  EXPECT_EQ(Json::parse(outcome.out)["dt_s"], 0.002);
}

TEST(Cli, RunCountsDeadlinesInRealTime) {
  const Outcome outcome = Adhesim("run " + FallingScene() + " --steps 20 --realtime --json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_GE(Json::parse(outcome.out)["deadline_misses"], 0);
}

// No step ends in a nanosecond, and each does in a thousand seconds.
TEST(Cli, RunGivesUpFidelityWhenStepsExceedTheirBudgetAndTheRecordingReplays) {
  const std::string recording = TempFile("governed.mcap");
  const std::string run = "run " + FallingScene() + " --steps 60 --realtime --json ";
  const Outcome late = Adhesim(run + "--step-budget 1e-9 --record " + recording);
  ASSERT_EQ(late.exit_code, 0) << late.err;
  const Json fidelity = Json::parse(late.out)["fidelity"];
  const std::size_t rungs = fidelity["rungs"].size();
  ASSERT_GE(rungs, 1u);
  EXPECT_EQ(fidelity["changes"], rungs);  // down to the last of them, and not up again
  ASSERT_EQ(fidelity["steps_without"].size(), rungs + 1);
  EXPECT_GT(fidelity["steps_without"][0], 0);
  EXPECT_GT(fidelity["steps_without"][rungs], 0);
  const Outcome replay = Adhesim("replay " + recording + " --verify");
  EXPECT_EQ(replay.exit_code, 0) << replay.err;

  const Json early = Json::parse(Adhesim(run + "--step-budget 1000").out)["fidelity"];
  EXPECT_EQ(early["changes"], 0);
  EXPECT_EQ(early["steps_without"][0], 60);
}

TEST(Cli, ABudgetNeedsDeadlines) {
  const Outcome outcome = Adhesim("run " + FallingScene() + " --steps 5 --step-budget 0.001");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--realtime"));
}

TEST(Cli, RunStopsCleanlyOnInterrupt) {
  const std::string out = TempFile("interrupted");
  // SIGINT would be ignored by a background job of the shell; SIGTERM takes the same way.
  const std::string command = std::string("timeout --preserve-status -s TERM 1 ") +
                              ADHESIM_PROGRAM + " run " + FallingScene() +
                              " --seconds 1000 --realtime --json >" + out;
  const int status = std::system(command.c_str());
  EXPECT_EQ(WEXITSTATUS(status), 130);
  EXPECT_EQ(Json::parse(ReadAll(out))["interrupted"], true);
}

// The program in a folder of its own, with what the shell script `bench` says as adhesim_bench;
// without one if that is empty.
std::string ProgramBeside(const std::string& bench) {
  namespace fs = std::filesystem;
  const fs::path folder = TempFile(bench.empty() ? "alone" : "beside");
  fs::create_directories(folder);
  fs::copy_file(ADHESIM_PROGRAM, folder / "adhesim", fs::copy_options::overwrite_existing);
  if (!bench.empty()) {
    std::ofstream(folder / "adhesim_bench") << "#!/bin/sh\n" << bench << "\n";
    fs::permissions(folder / "adhesim_bench", fs::perms::owner_all);
  }
  return folder / "adhesim";
}

TEST(Cli, BenchIsTheProgramBesideItWithAllItsArgumentsAndItsExitCode) {
  const std::string program =
      ProgramBeside("for word in \"$@\"; do echo \"<$word>\"; done; exit 7");
  const Outcome outcome = CallProgram(program, "bench one --seconds 0.5 'two three' --help");
  EXPECT_EQ(outcome.exit_code, 7) << outcome.err;
  EXPECT_EQ(outcome.out, "<one>\n<--seconds>\n<0.5>\n<two three>\n<--help>\n");
  EXPECT_EQ(CallProgram(program, "bench --json file --help").out, "<--json>\n<file>\n<--help>\n");
  EXPECT_EQ(CallProgram(program, "bench").out, "");
}

TEST(Cli, BenchSaysWhereItsProgramIsMissing) {
  const std::string program = ProgramBeside("");
  const Outcome outcome = CallProgram(program, "bench");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("cannot run " + program + "_bench"));
}

TEST(Cli, RunPrintsAFewLinesForPeople) {
  const Outcome outcome = Adhesim("run " + FallingScene() + " --steps 10");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out, StartsWith("falling: 84 particles"));
}

TEST(Cli, SaysWhatTetrahedraAre) {
  const std::string surface = TempFile("box.obj"), file = TempFile("one.msh");
  std::ofstream(surface)
      << "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  const Outcome carried = Adhesim("mesh info --json --scale 0.01 --tetrahedra 8 " + surface);
  ASSERT_EQ(carried.exit_code, 0) << carried.err;
  const Json json = Json::parse(carried.out)["tetrahedra"];
  EXPECT_EQ(json["carried_vertices"], 4);
  EXPECT_EQ(json["components"], 1);
  // A corner of a cube of 10 cm; filled to the accuracy of its samples.
  EXPECT_NEAR(json["filled_volume"].get<double>(), 1e-3 / 6, 0.02e-3 / 6);
  EXPECT_GT(json["stable_step_s"].get<double>(), 0);
  std::ofstream(file) << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n"
                         "3 0 1 0\n4 0 0 1\n$EndNodes\n$Elements\n1\n1 4 2 5 1 1 2 3 4\n"
                         "$EndElements\n";
  const Outcome read = Adhesim("mesh info --young 1000 --density 1000 --poisson 0 " + file);
  EXPECT_THAT(read.out, HasSubstr("label     5: volume 0.166667"));
  EXPECT_THAT(read.out, HasSubstr("dihedral angles 54.7 to 90.0 deg"));
  EXPECT_EQ(Adhesim("mesh info --tetrahedra 3 " + file).exit_code, 2);
  EXPECT_EQ(Adhesim("mesh info --tetrahedra 0 " + surface).exit_code, 2);
}

TEST(Cli, ExplainsWhatASceneSwitchesOn) {
  const std::string scene = FallingScene();
  const Outcome text = Adhesim("scene explain " + scene);
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr(scene + ":6\n"));
  EXPECT_THAT(text.out, HasSubstr("Left out\n"));
  const Json json = Json::parse(Adhesim("scene explain " + scene + " --json").out);
  EXPECT_EQ(json["effects"][2]["name"], "uniform_gravity");
  EXPECT_EQ(json["effects"][2]["line"], 8);
  ASSERT_FALSE(json["stages"].empty());
  for (const Json& stage : json["stages"]) {
    EXPECT_FALSE(stage["asked_by"].empty()) << stage;
    for (const Json& asked : stage["asked_by"]) EXPECT_GT(asked["line"], 0) << stage;
  }
  const auto gravity = std::find_if(json["stages"].begin(), json["stages"].end(),
                                    [](const Json& s) { return s["name"] == "uniform_gravity"; });
  ASSERT_NE(gravity, json["stages"].end());
  EXPECT_EQ((*gravity)["asked_by"][0]["line"], 8);
  // At least the force of every particle, and not more than a thousand times that.
  EXPECT_GE((*gravity)["bytes"], 24 * json["particles"].get<int>());
  EXPECT_LT((*gravity)["bytes"], 24000 * json["particles"].get<int>());
  EXPECT_GT(json["engine_bytes"], (*gravity)["bytes"]);
  for (const Json& effect : json["left_out"]) EXPECT_NE(effect["name"], "uniform_gravity");
}

TEST(Cli, ExplainsSleepWhereItIsSwitchedOn) {
  const auto names = [](const Json& stages) {
    std::vector<std::string> all;
    for (const Json& stage : stages) all.push_back(stage["name"]);
    return all;
  };
  const Json without = Json::parse(Adhesim("scene explain " + FallingScene() + " --json").out);
  EXPECT_THAT(names(without["stages"]), Not(Contains("sleep")));
  EXPECT_THAT(names(without["absent_stages"]), Contains("sleep"));

  const std::string scene = FallingScene();
  std::ofstream(scene, std::ios::app) << "sleep: {speed_m_s: 0.001}\n";
  const Json with = Json::parse(Adhesim("scene explain " + scene + " --json").out);
  ASSERT_THAT(names(with["stages"]), Contains("sleep"));
  EXPECT_THAT(names(with["absent_stages"]), Not(Contains("sleep")));
  for (const Json& stage : with["stages"]) {
    if (stage["name"] != "sleep") continue;
    EXPECT_EQ(stage["asked_by"][0]["line"], 9);
    EXPECT_GT(stage["bytes"], 0);
  }
}

}  // namespace
}  // namespace adhesim
