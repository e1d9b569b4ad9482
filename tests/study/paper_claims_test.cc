#include "core/study/paper_claims.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "core/study/paper_rivals.h"

namespace adhesim::test {
namespace {

// A run with nothing to complain of: two bodies that meet and hold.
PaperStudy Good() {
  PaperStudy study;
  study.bodies = 2;
  study.particles = 84;
  study.triangles = 160;
  study.capture_distance_m = 0.012;
  study.release_distance_m = 0.018;
  study.smallest_radius_m = 0.6;
  study.reference_j = 10;
  for (int i = 0; i <= 8; ++i) {
    StudySample sample;
    sample.time_s = i;
    sample.colliding_particles = std::min(3 * i, 12);
    sample.energy_j = 2;
    sample.permitted_j = 5;
    sample.radius_m = i < 4 ? 2 - 0.25 * i : 1;
    sample.separation_m = 1;
    sample.group_bodies = i > 0 ? 2 : 1;
    sample.mean_gap_m = 0.011;
    sample.volume_error = 1e-13;
    sample.max_depth_m = 0;
    sample.vertices_inside = 0;
    study.samples.push_back(sample);
  }
  return study;
}

PaperFigure FigureOf(Story story) {
  PaperFigure figure;
  figure.scene = "two";
  figure.particles = 84;
  figure.triangles = 160;
  figure.story = story;
  return figure;
}

Verdict VerdictOf(const std::string& id, const PaperFigure& figure, const PaperStudy& study,
                  bool whole = true) {
  for (const Claim& claim : JudgeFigure(figure, study, whole)) {
    if (claim.id == id) return claim.verdict;
  }
  ADD_FAILURE() << "no claim " << id;
  return Verdict::kNotJudged;
}

TEST(PaperClaims, AllHoldForAGoodRun) {
  for (const Story story :
       {Story::kNone, Story::kEndsTogether, Story::kAggregates, Story::kHoldsAll}) {
    for (const Claim& claim : JudgeFigure(FigureOf(story), Good(), true)) {
      EXPECT_EQ(claim.verdict, Verdict::kHolds) << claim.id << " " << claim.value;
    }
  }
}

TEST(PaperClaims, EachFailsByItsOwnNumber) {
  using Spoil = void (*)(PaperStudy*);
  struct Case {
    const char* claim;
    Spoil spoil;
  };
  const Case cases[] = {
      {"finite", [](PaperStudy* s) { s->finite = false; }},
      {"particles", [](PaperStudy* s) { s->particles = 85; }},
      {"triangles", [](PaperStudy* s) { s->triangles = 161; }},
      {"capture_distance", [](PaperStudy* s) { s->capture_distance_m = 0.0121; }},
      {"depth", [](PaperStudy* s) { s->samples[3].max_depth_m = 0.0121; }},
      {"inside", [](PaperStudy* s) { s->samples[3].vertices_inside = 1; }},
      {"contact_energy", [](PaperStudy* s) { s->samples.back().contact_added_j = 1.1e-8; }},
      {"whole_energy", [](PaperStudy* s) { s->samples[4].energy_j = 5.11; }},
      {"ledger", [](PaperStudy* s) { s->identity_error = 1.1e-9; }},
      {"momentum", [](PaperStudy* s) { s->momentum_angular = 1.1e-10; }},
      {"onset", [](PaperStudy* s) { s->samples[2].time_s = 2.1, s->samples[1].time_s = 0.1; }},
      {"volume", [](PaperStudy* s) { s->samples[1].volume_error = 1.1e-9; }},
  };
  for (const Case& one : cases) {
    PaperStudy study = Good();
    one.spoil(&study);
    for (const Claim& claim : JudgeFigure(FigureOf(Story::kNone), study, true)) {
      EXPECT_EQ(claim.verdict, claim.id == one.claim ? Verdict::kFails : Verdict::kHolds)
          << one.claim << ": " << claim.id;
    }
  }
}

TEST(PaperClaims, NotANumberHoldsNothing) {
  PaperStudy study = Good();
  study.identity_error = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(VerdictOf("ledger", FigureOf(Story::kNone), study), Verdict::kFails);
}

TEST(PaperClaims, StrongEndsTogetherAndWeakApart) {
  PaperStudy study = Good();
  EXPECT_EQ(VerdictOf("apart", FigureOf(Story::kEndsApart), study), Verdict::kFails);
  study.samples.back().colliding_particles = 0;
  EXPECT_EQ(VerdictOf("apart", FigureOf(Story::kEndsApart), study), Verdict::kHolds);
  EXPECT_EQ(VerdictOf("together", FigureOf(Story::kEndsTogether), study), Verdict::kFails);
  // Bodies that never met have not parted.
  for (StudySample& sample : study.samples) sample.colliding_particles = 0;
  EXPECT_EQ(VerdictOf("met", FigureOf(Story::kEndsApart), study), Verdict::kFails);
}

TEST(PaperClaims, AnAggregateRisesGathersAndSettles) {
  const PaperFigure figure = FigureOf(Story::kAggregates);
  PaperStudy study = Good();
  study.samples[8].colliding_particles = 5;
  EXPECT_EQ(VerdictOf("rises", figure, study), Verdict::kFails);
  study = Good();
  study.samples[8].radius_m = 1.6;
  EXPECT_EQ(VerdictOf("gathers", figure, study), Verdict::kFails);
  study = Good();
  study.samples[8].radius_m = 0.9;
  EXPECT_EQ(VerdictOf("plateau", figure, study), Verdict::kFails);
  study = Good();
  study.samples[8].group_bodies = 1;
  EXPECT_EQ(VerdictOf("one_aggregate", figure, study), Verdict::kFails);
  study = Good();
  study.samples[8].mean_gap_m = std::nullopt;
  EXPECT_EQ(VerdictOf("no_empty_space", figure, study), Verdict::kFails);
}

TEST(PaperClaims, ABallRollsAWholeTurnWithLittleSlip) {
  const PaperFigure figure = FigureOf(Story::kRolls);
  PaperStudy study = Good();
  EXPECT_EQ(VerdictOf("revolutions", figure, study), Verdict::kFails);
  EXPECT_EQ(VerdictOf("slip", figure, study), Verdict::kFails);
  study.samples.back().revolutions = 1.01;
  study.samples.back().travel_m = 4;
  study.samples.back().slip_m = 0.19;
  EXPECT_EQ(VerdictOf("revolutions", figure, study), Verdict::kHolds);
  EXPECT_EQ(VerdictOf("slip", figure, study), Verdict::kHolds);
  study.samples.back().slip_m = 0.21;
  EXPECT_EQ(VerdictOf("slip", figure, study), Verdict::kFails);
}

TEST(PaperClaims, EveryBodyHoldsOn) {
  PaperStudy study = Good();
  EXPECT_EQ(VerdictOf("holds_all", FigureOf(Story::kHoldsAll), study), Verdict::kHolds);
  study.samples.back().group_bodies = 1;
  EXPECT_EQ(VerdictOf("holds_all", FigureOf(Story::kHoldsAll), study), Verdict::kFails);
  // Bodies that hold on in two zones are one group, and not one zone.
  study = Good();
  EXPECT_EQ(VerdictOf("one_zone", FigureOf(Story::kOneZone), study), Verdict::kFails);
  study.samples.back().zone_bodies = 2;
  EXPECT_EQ(VerdictOf("one_zone", FigureOf(Story::kOneZone), study), Verdict::kHolds);
}

TEST(PaperClaims, AMusclePullsTheBoneAndLetsGo) {
  const PaperFigure figure = FigureOf(Story::kPulls);
  PaperStudy study = Good();
  for (StudySample& sample : study.samples) sample.moved_m = 0;
  EXPECT_EQ(VerdictOf("pulled", figure, study), Verdict::kFails);
  EXPECT_EQ(VerdictOf("returned", figure, study), Verdict::kFails);
  study.samples[4].moved_m = 0.1;
  EXPECT_EQ(VerdictOf("pulled", figure, study), Verdict::kHolds);
  EXPECT_EQ(VerdictOf("returned", figure, study), Verdict::kHolds);
  study.samples.back().moved_m = 0.011;
  EXPECT_EQ(VerdictOf("returned", figure, study), Verdict::kFails);
}

TEST(PaperClaims, WhatHangsIsAtRest) {
  const PaperFigure figure = FigureOf(Story::kHangs);
  PaperStudy study = Good();
  EXPECT_EQ(VerdictOf("hangs", figure, study), Verdict::kFails);  // no such body
  study.samples.back().speed_m_s = 0.009;
  EXPECT_EQ(VerdictOf("hangs", figure, study), Verdict::kHolds);
  study.samples.back().speed_m_s = 0.011;
  EXPECT_EQ(VerdictOf("hangs", figure, study), Verdict::kFails);
}

TEST(PaperRivals, AreJudgedByWhatTheyAdd) {
  const auto verdict = [](const char* id, double low_j, double high_j) {
    RivalResult result;
    for (const Rival& rival : PaperRivals()) {
      if (rival.id == id) result.rival = &rival;
    }
    for (const double above_j : {low_j, high_j}) {
      RivalRun& run = result.runs.emplace_back();
      run.study = Good();
      run.study.samples[3].energy_j = run.study.samples[3].permitted_j + above_j;
    }
    const std::vector<Claim> claims = JudgeRivals({result});
    return claims.size() == 1 ? claims[0].verdict : Verdict::kNotJudged;
  };
  // Of the 10 J of E_ref.
  EXPECT_EQ(verdict("adhesive", 0.09, 0.09), Verdict::kHolds);
  EXPECT_EQ(verdict("adhesive", 0.09, 0.11), Verdict::kFails);
  EXPECT_EQ(verdict("adhesive", 0.11, 0.09), Verdict::kFails);
  EXPECT_EQ(verdict("links", 0.2, 0.2), Verdict::kHolds);
  EXPECT_EQ(verdict("links", 0.2, 0.01), Verdict::kFails);  // it would vanish with the step
  EXPECT_EQ(verdict("impulses", 0.2, 0.01), Verdict::kHolds);
  EXPECT_EQ(verdict("impulses", 0.01, 0.01), Verdict::kFails);
  EXPECT_EQ(verdict("penalty", 0.2, 0.2), Verdict::kNotJudged);
}

TEST(PaperRivals, PartAfterTheyWereNearest) {
  PaperStudy study = Good();
  for (int i = 0; i <= 8; ++i) study.samples[i].separation_m = 1 + std::abs(i - 4.0);
  study.samples[0].separation_m = 9;
  study.samples[2].max_depth_m = 0.003;
  EXPECT_EQ(PartedTo(study), 5);
  EXPECT_EQ(GreatestDepth(study), 0.003);
}

TEST(PaperClaims, WhatOnlyTheEndShowsIsNotJudgedBeforeIt) {
  PaperStudy study = Good();
  study.samples.back().colliding_particles = 0;
  study.samples[2].vertices_inside = 1;
  const PaperFigure figure = FigureOf(Story::kEndsTogether);
  EXPECT_EQ(VerdictOf("together", figure, study, false), Verdict::kNotJudged);
  EXPECT_EQ(VerdictOf("inside", figure, study, false), Verdict::kFails);
}

TEST(PaperClaims, LimitsReadAsTheyAreMeant) {
  EXPECT_EQ(LimitText({"", "", "m", 0, Relation::kAtMost, 0.012}), "at most 0.012 m");
  EXPECT_EQ(LimitText({"", "", "", 0, Relation::kAtLeast, 1}), "at least 1");
  EXPECT_EQ(LimitText({"", "", "", 0, Relation::kIs, 1280}), "exactly 1280");
}

TEST(PaperFigures, EachHasASceneAndInstantsInOrder) {
  std::set<std::string_view> scenes;
  for (const PaperFigure& figure : PaperFigures()) {
    EXPECT_TRUE(scenes.insert(figure.scene).second) << figure.scene;
    EXPECT_TRUE(std::filesystem::exists(std::string(ADHESIM_SOURCE_DIR "/scenes/paper/") +
                                        std::string(figure.scene) + ".yaml"))
        << figure.scene;
    EXPECT_GT(figure.duration_s, 0);
    // Stories of one body need to know which.
    EXPECT_EQ(figure.followed.empty(), figure.story != Story::kRolls &&
                                           figure.story != Story::kPulls &&
                                           figure.story != Story::kHangs)
        << figure.scene;
    ASSERT_FALSE(figure.instants.empty());
    EXPECT_TRUE(std::is_sorted(figure.instants.begin(), figure.instants.end()));
    EXPECT_GE(figure.instants.front(), 0);
    EXPECT_LE(figure.instants.back(), 1);
  }
}

}  // namespace
}  // namespace adhesim::test
