#include "core/scene/validate.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "core/scene/scene_file.h"
#include "tests/scene/sample_scene.h"

namespace adhesim {
namespace {

using ::testing::HasSubstr;

v1::Scene Sample() { return ParseScene(SampleScene(), "sample.yaml", "").scene; }

// "path: message" of every problem.
std::string Described(const v1::Scene& scene) {
  std::string text;
  for (const Problem& problem : ValidateScene(scene))
    text += problem.path + ": " + problem.message + "\n";
  return text;
}

TEST(ValidateScene, AcceptsAValidScene) { EXPECT_EQ(Described(Sample()), ""); }

TEST(ValidateScene, AcceptsItsOwnDefaults) { EXPECT_EQ(Described(WithDefaults(Sample())), ""); }

TEST(ValidateScene, RefusesNumbersThatAreNotFinite) {
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    v1::Scene scene = Sample();
    scene.set_rate_hz(value);
    scene.mutable_bodies(0)->set_position_m(1, value);
    EXPECT_THAT(Described(scene), HasSubstr("rate_hz: is "));
    EXPECT_THAT(Described(scene), HasSubstr("bodies[0].position_m[1]: is "));
  }
}

TEST(ValidateScene, RefusesContradictingStrengths) {
  v1::Scene scene = Sample();
  v1::VirtualAdhesive* adhesive = scene.mutable_effects(6)->mutable_virtual_adhesive();
  adhesive->set_kappa_adh_m(1e-5);
  EXPECT_THAT(Described(scene),
              HasSubstr("effects[6].virtual_adhesive.kappa_adh_m: excludes normal_strength_pa"));
  adhesive->clear_kappa_adh_m();
  adhesive->clear_normal_strength_pa();
  adhesive->set_shear_strength_pa(1);
  EXPECT_THAT(Described(scene),
              HasSubstr("effects[6].virtual_adhesive.shear_strength_pa: needs normal_strength_pa"));
}

TEST(ValidateScene, WarnsOfTetrahedraThatNothingHoldsTogether) {
  const auto problems = [](const std::string& effects) {
    const SceneFile file = ParseScene(
        "bodies:\n  - {name: a, block: {size_m: [1, 1, 1]}, tetrahedra: {cells: 2}, mass_kg: 1}\n"
        "  - {name: b, block: {size_m: [1, 1, 1]}, tetrahedra: {cells: 2}, mass_kg: 1,\n"
        "     fixed: [all: true]}\n" +
            effects,
        "dust.yaml", "");
    EXPECT_TRUE(file.ok());
    return file.Format(file.problems);
  };
  EXPECT_THAT(problems(""), HasSubstr("2:43: warning: bodies[0].tetrahedra: no effect holds"));
  EXPECT_THAT(problems(""), ::testing::Not(HasSubstr("bodies[1]")));
  EXPECT_THAT(problems("effects:\n  - elasticity: {young_modulus_pa: 1000, bodies: [b]}\n"),
              HasSubstr("needed: the effect elasticity on this body"));
  EXPECT_EQ(problems("effects:\n  - elasticity: {young_modulus_pa: 1000}\n"), "");
}

TEST(ValidateScene, WarnsOfVolumePreservationThatActsOnNoTissue) {
  const auto problems = [](const std::string& more, const std::string& bodies) {
    const SceneFile file = ParseScene(
        "effects:\n  - volume_preservation: {" + bodies +
            "}\n  - elasticity: {young_modulus_pa: 1000}\nbodies:\n"
            "  - {name: a, block: {size_m: [1, 1, 1]}, tetrahedra: {cells: 2}, mass_kg: 1}\n" +
            more,
        "kept.yaml", "");
    EXPECT_TRUE(file.ok());
    return file.Format(file.problems);
  };
  EXPECT_THAT(problems("", ""),
              HasSubstr("2:5: warning: effects[0].volume_preservation: acts on nothing"));
  EXPECT_EQ(problems("", "bodies: [a]"), "");
  EXPECT_EQ(problems("  - {name: b, icosphere: {radius_m: 1}, mass_kg: 1}\n", ""), "");
  const std::string rigid = "  - {name: b, icosphere: {radius_m: 1}, mass_kg: 1, kind: rigid}\n";
  EXPECT_THAT(problems(rigid, ""), HasSubstr("warning"));
}

TEST(ValidateScene, RefusesARegionOfAllThatIsNot) {
  v1::Scene scene = Sample();
  v1::Elasticity* elasticity = scene.add_effects()->mutable_elasticity();
  elasticity->set_young_modulus_pa(1000);
  elasticity->add_regions()->mutable_where()->set_all(false);
  EXPECT_THAT(Described(scene), HasSubstr("where.all: must be true; to select nothing"));
}

TEST(ValidateScene, RefusesTheBorderAsAPartOfAVolume) {
  v1::Scene scene = Sample();
  v1::Elasticity* elasticity = scene.add_effects()->mutable_elasticity();
  elasticity->set_young_modulus_pa(1000);
  v1::MaterialRegion* region = elasticity->add_regions();
  region->set_young_modulus_pa(2000);
  region->mutable_where()->set_border(true);
  EXPECT_THAT(Described(scene), HasSubstr("regions[0].where.border: is a part of surfaces"));
  region->clear_where();
  EXPECT_THAT(Described(scene), HasSubstr("regions[0].where: required"));
}

// Two blocks of tissue that stick; `block` is what the second one is.
std::string WorkOfAdhesionProblems(const std::string& block, const std::string& effects) {
  return Described(ParseScene(R"(
bodies:
  - {name: organ, block: {size_m: [0.1, 0.1, 0.1]}, tetrahedra: {cells: 2}, density_kg_m3: 1000}
  - {name: flap, block: {size_m: [0.1, 0.1, 0.1]}, position_m: [0, 0, 0.1], )" +
                                  block + "}\neffects:\n" + effects,
                              "tissue.yaml", "")
                       .scene);
}

TEST(ValidateScene, AsksForTissueWhereAWorkOfAdhesionIsGiven) {
  const std::string elastic = "  - elasticity: {young_modulus_pa: 5000}\n";
  const std::string sticky =
      "  - virtual_adhesive: {capture_distance_m: 0.001, work_of_adhesion_j_m2: 1}\n";
  EXPECT_EQ(WorkOfAdhesionProblems("tetrahedra: {cells: 2}, density_kg_m3: 1000", elastic + sticky),
            "");
  EXPECT_EQ(WorkOfAdhesionProblems("kind: rigid, mass_kg: 1", elastic + sticky), "");
  EXPECT_EQ(WorkOfAdhesionProblems("mass_kg: 1, fixed: [all: true]", elastic + sticky), "");
  EXPECT_THAT(WorkOfAdhesionProblems("mass_kg: 1", elastic + sticky),
              HasSubstr("effects[1].virtual_adhesive.work_of_adhesion_j_m2: needs the stiffness of "
                        "body 'flap', which is a surface; permitted: bodies of tetrahedra"));
  EXPECT_THAT(WorkOfAdhesionProblems("tetrahedra: {cells: 2}, density_kg_m3: 1000", sticky),
              HasSubstr("virtual_adhesive.work_of_adhesion_j_m2: needs the effect elasticity"));
}

TEST(ValidateScene, AsksForTissueWhereAToolHasAWorkOfAdhesion) {
  v1::Scene scene = Sample();
  scene.mutable_tools(0)->mutable_adhesion()->set_work_of_adhesion_j_m2(1);
  EXPECT_THAT(Described(scene),
              HasSubstr("tools[0].adhesion.work_of_adhesion_j_m2: needs the stiffness of body"));
}

TEST(ValidateScene, RefusesAWorkOfAdhesionBesideKappa) {
  EXPECT_THAT(
      WorkOfAdhesionProblems("tetrahedra: {cells: 2}, density_kg_m3: 1000",
                             "  - elasticity: {young_modulus_pa: 5000}\n"
                             "  - virtual_adhesive: {capture_distance_m: 0.001, kappa_adh_m: "
                             "1e-5, work_of_adhesion_j_m2: 1}\n"),
      HasSubstr("work_of_adhesion_j_m2: lowers strengths in Pa, and kappa_adh_m is none"));
}

TEST(ValidateScene, RefusesReleaseBelowCapture) {
  v1::Scene scene = Sample();
  scene.mutable_effects(6)->mutable_virtual_adhesive()->set_release_distance_m(0.002);
  EXPECT_THAT(Described(scene),
              HasSubstr("virtual_adhesive.release_distance_m: is 0.002; permitted: above 0.002"));
}

TEST(ValidateScene, RefusesLinksThatBreakWhenMade) {
  v1::Scene scene = Sample();
  v1::ElasticLinks* links = scene.add_effects()->mutable_elastic_links();
  links->set_capture_distance_m(0.002);
  links->set_stiffness_n_m(1);
  links->set_max_length_m(0.002);
  EXPECT_THAT(Described(scene),
              HasSubstr("elastic_links.max_length_m: is 0.002; permitted: above 0.002"));
}

TEST(ValidateScene, RefusesTwoAdhesives) {
  v1::Scene scene = Sample();
  *scene.add_effects() = scene.effects(6);
  EXPECT_THAT(Described(scene),
              HasSubstr("effects[7].virtual_adhesive: is already in the scene as effects[6]"));
}

TEST(ValidateScene, RefusesOneElasticEffectTwiceOnABody) {
  v1::Scene scene = Sample();
  scene.mutable_effects(1)
      ->mutable_shape_memory()
      ->clear_bodies();  // all deformable bodies: cell_a among them
  EXPECT_THAT(Described(scene),
              HasSubstr("effects[1].shape_memory: acts on body 'cell_a', as effects[0]"));
}

TEST(ValidateScene, RefusesElasticityOfARigidBody) {
  v1::Scene scene = Sample();
  scene.mutable_effects(0)->mutable_shape_memory()->set_bodies(0, "cell_b");
  EXPECT_THAT(Described(scene),
              HasSubstr("effects[0].shape_memory.bodies[0]: body 'cell_b' is rigid"));
}

TEST(ValidateScene, RefusesABodyListedTwice) {
  v1::Scene scene = Sample();
  scene.mutable_effects(0)->mutable_shape_memory()->add_bodies("cell_a");
  EXPECT_THAT(Described(scene),
              HasSubstr("effects[0].shape_memory.bodies[1]: 'cell_a' is listed twice"));
}

TEST(ValidateScene, RefusesWaypointsOutOfOrder) {
  v1::Scene scene = Sample();
  scene.mutable_tools(0)->mutable_trajectory(1)->set_t_s(0);
  EXPECT_THAT(Described(scene), HasSubstr("tools[0].trajectory[1].t_s: is 0; permitted: above 0"));
}

TEST(ValidateScene, RefusesQuaternionsThatAreNotUnit) {
  v1::Scene scene = Sample();
  scene.mutable_tools(0)->mutable_trajectory(1)->set_orientation_wxyz(0, 0.9);
  scene.mutable_tools(1)->clear_orientation_wxyz();
  for (const double value : {0.0, 0.0, 0.0, 0.0})
    scene.mutable_tools(1)->add_orientation_wxyz(value);
  EXPECT_THAT(Described(scene),
              HasSubstr("tools[0].trajectory[1].orientation_wxyz: is a quaternion of length"));
  EXPECT_THAT(Described(scene),
              HasSubstr("tools[1].orientation_wxyz: is a quaternion of length 0"));
}

TEST(ValidateScene, RefusesANormalWithoutDirectionAndRegionsOfNothing) {
  v1::Scene scene = Sample();
  scene.mutable_bodies(2)->mutable_fixed(2)->mutable_half_space()->set_normal(2, 0);
  scene.mutable_bodies(2)->mutable_fixed(0)->set_border(false);
  EXPECT_THAT(Described(scene),
              HasSubstr("bodies[2].fixed[2].half_space.normal: has no direction"));
  EXPECT_THAT(Described(scene), HasSubstr("bodies[2].fixed[0].border: must be true"));
}

// What a rung changes of the force is asked for where a tool feels one.
TEST(ValidateScene, AsksForErrorsOfForcesWhereThereAreTools) {
  v1::Scene scene = Sample();
  scene.mutable_rungs()->mutable_detection()->set_position_error(0.1);
  EXPECT_THAT(Described(scene), HasSubstr("rungs.detection.force_error: required"));
  scene.mutable_rungs()->mutable_detection()->set_force_error(0.1);
  EXPECT_EQ(Described(scene), "");
  scene.mutable_rungs()->mutable_detection()->set_force_error(
      std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(Described(scene), HasSubstr("rungs.detection.force_error: is nan; permitted"));
}

TEST(ValidateScene, RefusesFieldsAndValuesOfALaterVersion) {
  v1::Scene scene = Sample();
  scene.mutable_bodies(0)->set_kind(static_cast<v1::BodyKind>(77));
  scene.mutable_bodies(1)
      ->GetReflection()
      ->MutableUnknownFields(scene.mutable_bodies(1))
      ->AddVarint(9999, 1);
  EXPECT_THAT(Described(scene),
              HasSubstr("bodies[0].kind: unknown value 77; permitted: deformable, rigid"));
  EXPECT_THAT(Described(scene),
              HasSubstr("bodies[1]: Body has fields that this version does not know"));
}

TEST(ValidateScene, RefusesAnEmptySceneAndAnEmptyName) {
  EXPECT_THAT(Described(v1::Scene()), HasSubstr("bodies: the scene has no body"));
  v1::Scene scene = Sample();
  scene.mutable_bodies(0)->set_name("");
  EXPECT_THAT(Described(scene), HasSubstr("bodies[0].name: must not be empty"));
}

TEST(WithDefaults, WritesEveryDefault) {
  const v1::Scene scene = WithDefaults(Sample());
  EXPECT_EQ(scene.schema_version(), 1u);
  EXPECT_EQ(scene.bodies(2).position_m_size(), 3);
  EXPECT_EQ(scene.bodies(0).kind(), v1::BODY_KIND_DEFORMABLE);
  EXPECT_EQ(scene.tools(0).coupling().max_force_n(), 10);
  EXPECT_EQ(scene.tools(0).orientation_wxyz(0), 1);
  EXPECT_EQ(scene.tools(0).trajectory(0).orientation_wxyz_size(), 4);
  EXPECT_EQ(scene.tools(0).adhesion().shear_strength_pa(), 3000);
  EXPECT_EQ(scene.effects(3).uniform_gravity().acceleration_m_s2(2), -9.81);
  EXPECT_EQ(scene.effects(6).virtual_adhesive().release_distance_m(), 1.5 * 0.002);
  EXPECT_EQ(scene.effects(6).virtual_adhesive().shear_strength_pa(), 100);
}

TEST(WithDefaults, LeavesOffWhatIsOff) {
  const v1::Scene scene = WithDefaults(Sample());
  EXPECT_FALSE(scene.tools(1).has_adhesion());
  EXPECT_TRUE(scene.tools(1).trajectory().empty());
  EXPECT_TRUE(scene.bodies(0).fixed().empty());
  EXPECT_EQ(scene.effects_size(), 7);
  EXPECT_FALSE(scene.has_rungs());
  EXPECT_TRUE(scene.has_integration());
}

TEST(WithDefaults, ChangesNothingTheSecondTime) {
  const v1::Scene once = WithDefaults(Sample());
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(once, WithDefaults(once)));
}

// Every default of every message can be read and lies in the range of its field.
TEST(WithDefaults, OfEveryMessageAreValid) {
  v1::Scene scene = Sample();
  for (const char* name : {"image", "file", "block", "organ"}) {
    v1::Body* body = scene.add_bodies();
    body->set_name(name);
    body->set_mass_kg(1);
    body->set_kind(v1::BODY_KIND_RIGID);
  }
  scene.mutable_bodies(3)->mutable_label_map()->set_file("x");
  scene.mutable_bodies(4)->mutable_mesh()->set_file("x");
  for (int i = 0; i < 3; ++i) scene.mutable_bodies(5)->mutable_block()->add_size_m(1);
  scene.mutable_bodies(6)->mutable_organ();
  EXPECT_EQ(Described(WithDefaults(scene)), "");
}

}  // namespace
}  // namespace adhesim
