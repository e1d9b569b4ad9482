#include <random>

#include "tests/tissue/tissue_sample.h"

// What was squashed, turned inside out or scrambled comes back.
namespace adhesim::test {
namespace {

using Spoil = Vec3 (*)(const Vec3& x, std::mt19937* random);

// Squashed into the plane z = 0.
Vec3 Flat(const Vec3& x, std::mt19937*) { return {x.x(), x.y(), 0}; }
// Mirrored: every tetrahedron is inside out.
Vec3 Inverted(const Vec3& x, std::mt19937*) { return {x.x(), x.y(), -x.z()}; }
// Every particle moved by up to half a cell along each axis: a part of the tetrahedra is inside
// out.
Vec3 Strewn(const Vec3& at, std::mt19937* random) {
  std::uniform_real_distribution<double> uniform(-0.0125, 0.0125);
  const double x = uniform(*random), y = uniform(*random), z = uniform(*random);
  return at + Vec3(x, y, z);
}
// Every particle anywhere in a box of the block's size.
Vec3 Scrambled(const Vec3&, std::mt19937* random) {
  std::uniform_real_distribution<double> uniform(-0.05, 0.05);
  const double x = uniform(*random), y = uniform(*random), z = uniform(*random);
  return {x, y, z};
}
// All particles in one point.
Vec3 Point(const Vec3&, std::mt19937*) { return Vec3::Zero(); }

double LeastVolumeRatio(const Engine& engine) {
  const Model& model = engine.model();
  const std::vector<Vec3>&x = engine.state().position_m, &rest = model.rest_position_m;
  const auto volume = [](const std::vector<Vec3>& at, const Tetrahedron& t) {
    return (at[t[1]] - at[t[0]]).cross(at[t[2]] - at[t[0]]).dot(at[t[3]] - at[t[0]]);
  };
  double least = 1;
  for (const Tetrahedron& t : model.tetrahedra) {
    least = std::min(least, volume(x, t) / volume(rest, t));
  }
  return least;
}

// Seconds until the block has its shape again, up to where it lies: no tetrahedron is 1 % from its
// volume, and the energy is 1e-6 of E V (a strain of about 1e-3). Negative: not within 5 s.
double RecoveryTime(const std::string& law, Spoil spoil) {
  TissueSample sample;
  sample.cells = 4;
  sample.poisson_ratio = 0.45;
  sample.law = law;
  sample.tolerance = 1e-4;
  sample.effects = "  - drag: {rate_per_s: 2}\n";
  const auto engine = EngineOf(sample.Make());
  State start = engine->state();
  std::mt19937 random(7);
  for (Vec3& x : start.position_m) x = spoil(x, &random);
  engine->Restore(start);
  const double scale_j = sample.young_modulus_pa * 1e-3;  // E V
  Tell("  energy at the start over E V", engine->MechanicalEnergy() / scale_j);
  for (int step = 0; step < 1000; ++step) {
    engine->Step({});
    if (engine->frozen()) break;
    if (LeastVolumeRatio(*engine) > 0.99 && engine->MechanicalEnergy() < 1e-6 * scale_j) {
      return engine->state().time_s;
    }
  }
  Tell("  least volume ratio at the end", LeastVolumeRatio(*engine));
  Tell("  energy at the end over E V", engine->MechanicalEnergy() / scale_j);
  return -1;
}

void ExpectRecovery(const std::string& law, const char* name, Spoil spoil) {
  const double time_s = RecoveryTime(law, spoil);
  Tell(law + ", " + name + ": seconds to recover", time_s);
  EXPECT_GT(time_s, 0) << law << " " << name;
}

TEST(Recovery, OfCorotationalTissueFromAnyShape) {
  ExpectRecovery("corotational", "flat", Flat);
  ExpectRecovery("corotational", "inverted", Inverted);
  ExpectRecovery("corotational", "in one point", Point);
  ExpectRecovery("corotational", "strewn by half a cell", Strewn);
  ExpectRecovery("corotational", "scrambled", Scrambled);
}

// Not from a thorough scramble: its energy has minima other than rest, in which every tetrahedron
// has a positive volume but the mesh goes round an edge twice (docs/tissue.md).
TEST(Recovery, OfNeoHookeanTissueFromFlatInvertedAndStrewnShapes) {
  ExpectRecovery("neo_hookean", "flat", Flat);
  ExpectRecovery("neo_hookean", "inverted", Inverted);
  ExpectRecovery("neo_hookean", "in one point", Point);
  ExpectRecovery("neo_hookean", "strewn by half a cell", Strewn);
}

}  // namespace
}  // namespace adhesim::test
