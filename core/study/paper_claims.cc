#include "core/study/paper_claims.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace adhesim {
namespace {

// Limits that the issue or the design's pages set.
constexpr double kCaptureShare = 0.02;  // d_on over the smallest radius
constexpr double kContactShare = 1e-9;  // what contact may add, of E_ref
constexpr double kWholeShare = 0.01;    // what an explicit step may have above what it got
constexpr double kIdentity = 1e-9;      // of the ledger
constexpr double kMomentum = 1e-10;     // of the balances
constexpr double kVolume = 1e-9;        // exact preservation stops its iteration at 1e-12
constexpr double kRadiusShare = 0.75;   // an aggregate's radius at the end, of the first
constexpr double kPlateauShare = 0.02;  // of the fall, still to come in the last quarter
constexpr double kHalfContactS = 2;     // simulated time in which half of it is there
constexpr double kSlipShare = 0.05;
constexpr double kPulledM = 0.06;        // a twentieth of the muscle's length
constexpr double kReturnedShare = 0.1;   // of the way that it was pulled
constexpr double kRestSpeedMS = 0.01;    // some thousandths of what falling for as long would give
constexpr double kLimitRoundOff = 1e-9;  // 12 mm of 0.6 m is 2 %

bool Holds(double value, Relation relation, double limit) {
  const double slack = kLimitRoundOff * std::abs(limit);
  switch (relation) {
    case Relation::kAtMost:
      return value <= limit + slack;
    case Relation::kAtLeast:
      return value >= limit - slack;
    case Relation::kIs:
      return std::abs(value - limit) <= slack;
  }
  return false;
}

class Judge {
 public:
  Judge(const PaperStudy& study, bool whole) : study_(study), whole_(whole) {}

  void Add(std::string id, std::string subject, std::string unit, double value, Relation relation,
           double limit) {
    claims_.push_back(
        Judged(std::move(id), std::move(subject), std::move(unit), value, relation, limit));
  }

  // A claim about the end of the story.
  void AddLast(std::string id, std::string subject, std::string unit, double value,
               Relation relation, double limit) {
    Add(std::move(id), std::move(subject), std::move(unit), value, relation, limit);
    if (!whole_) claims_.back().verdict = Verdict::kNotJudged;
  }

  const PaperStudy& study() const { return study_; }
  std::vector<Claim> Take() { return std::move(claims_); }

 private:
  const PaperStudy& study_;
  const bool whole_;
  std::vector<Claim> claims_;
};

void JudgeContact(Judge* judge) {
  const PaperStudy& study = judge->study();
  double depth = 0;
  int inside = 0;
  bool measured = false;
  for (const StudySample& sample : study.samples) {
    measured |= sample.max_depth_m.has_value();
    depth = std::max(depth, sample.max_depth_m.value_or(0));
    inside = std::max(inside, sample.vertices_inside.value_or(0));
  }
  if (!study.capture_distance_m) return;
  if (study.smallest_radius_m) {
    judge->Add("capture_distance", "capture distance over the smallest body's radius", "",
               *study.capture_distance_m / *study.smallest_radius_m, Relation::kAtMost,
               kCaptureShare);
  }
  if (!measured) return;
  judge->Add("depth", "deepest overlap (no deeper than the capture distance)", "m", depth,
             Relation::kAtMost, *study.capture_distance_m);
  judge->Add("inside", "particles inside another body", "", inside, Relation::kIs, 0);
}

void JudgeConservation(Judge* judge) {
  const PaperStudy& study = judge->study();
  // Nothing that had energy: nothing was added.
  const auto share = [&](double energy_j) {
    return study.reference_j > 0 ? energy_j / study.reference_j : 0;
  };
  double volume = 0;
  bool has_volume = false;
  for (const StudySample& sample : study.samples) {
    volume = std::max(volume, sample.volume_error.value_or(0));
    has_volume |= sample.volume_error.has_value();
  }
  judge->Add("contact_energy", "energy that contact added, of E_ref", "",
             share(study.samples.back().contact_added_j), Relation::kAtMost, kContactShare);
  judge->Add("whole_energy", "energy above the initial and the work done, of E_ref", "",
             EnergyExcess(study), Relation::kAtMost, kWholeShare);
  judge->Add("ledger", "imbalance of the energy ledger, of E_ref", "", study.identity_error,
             Relation::kAtMost, kIdentity);
  judge->Add("momentum", "imbalance of linear or angular momentum", "",
             std::max(study.momentum_linear, study.momentum_angular), Relation::kAtMost, kMomentum);
  if (has_volume) {
    judge->Add("volume", "largest error of a preserved volume", "", volume, Relation::kAtMost,
               kVolume);
  }
}

int MostColliding(const PaperStudy& study) {
  int most = 0;
  for (const StudySample& sample : study.samples) {
    most = std::max(most, sample.colliding_particles);
  }
  return most;
}

// Contact that is there at the end came early: times of a step are compared while it is there.
void JudgeOnset(Judge* judge) {
  const std::vector<StudySample>& samples = judge->study().samples;
  const int last = samples.back().colliding_particles;
  if (last == 0) return;
  const auto half = std::find_if(samples.begin(), samples.end(), [&](const StudySample& sample) {
    return 2 * sample.colliding_particles >= last;
  });
  judge->AddLast("onset", "simulated time until half of the last colliding particles", "s",
                 half->time_s, Relation::kAtMost, kHalfContactS);
}

void JudgeAggregate(Judge* judge) {
  const PaperStudy& study = judge->study();
  const std::vector<StudySample>& samples = study.samples;
  const StudySample& last = samples.back();
  // At the quarters: single steps may lose a particle.
  int fewer = 0;
  for (int quarter = 1; quarter <= 4; ++quarter) {
    const auto at = [&](int q) {
      return samples[(samples.size() - 1) * static_cast<std::size_t>(q) / 4].colliding_particles;
    };
    fewer += at(quarter) < at(quarter - 1);
  }
  judge->Add("rises", "quarters of the run in which the colliding particles became fewer", "",
             fewer, Relation::kIs, 0);
  judge->AddLast("gathers", "radius at the end over the first", "",
                 last.radius_m / samples.front().radius_m, Relation::kAtMost, kRadiusShare);
  const double fall = samples.front().radius_m - last.radius_m;
  const double late = std::abs(samples[(samples.size() - 1) * 3 / 4].radius_m - last.radius_m);
  judge->AddLast("plateau", "change of the radius in the last quarter over its whole fall", "",
                 fall > 0 ? late / fall : 1, Relation::kAtMost, kPlateauShare);
  judge->AddLast("one_aggregate", "bodies in the largest group at the end", "", last.group_bodies,
                 Relation::kIs, study.bodies);
  if (study.release_distance_m) {
    // Captured within the capture distance, tissue stretches; further apart than the release
    // distance it would not be contact. Without a pair there is nothing but empty space.
    const double gap = last.mean_gap_m.value_or(last.radius_m);
    judge->AddLast("no_empty_space", "mean gap of the pairs that hold, at the end", "m", gap,
                   Relation::kAtMost, *study.release_distance_m);
  }
}

void JudgeRolling(Judge* judge) {
  const StudySample& last = judge->study().samples.back();
  // A scene without a ball that rolls has rolled nowhere.
  judge->AddLast("revolutions", "revolutions of the ball", "", last.revolutions.value_or(0),
                 Relation::kAtLeast, 1);
  const double travel_m = last.travel_m.value_or(0);
  judge->AddLast("slip", "slip of the ball over its travel", "",
                 travel_m > 0 ? last.slip_m.value_or(0) / travel_m : 1, Relation::kAtMost,
                 kSlipShare);
}

void JudgeHoldsAll(Judge* judge) {
  judge->AddLast(
      "holds_all", "bodies that hold on to each other at the end, of all", "",
      static_cast<double>(judge->study().samples.back().group_bodies) / judge->study().bodies,
      Relation::kIs, 1);
}

void JudgePulling(Judge* judge) {
  const std::vector<StudySample>& samples = judge->study().samples;
  double furthest_m = 0;
  for (const StudySample& sample : samples) {
    furthest_m = std::max(furthest_m, sample.moved_m.value_or(0));
  }
  judge->AddLast("pulled", "way that the followed body is pulled", "m", furthest_m,
                 Relation::kAtLeast, kPulledM);
  const double left_m = samples.back().moved_m.value_or(furthest_m);
  judge->AddLast("returned", "what is left of that way at the end, over the way", "",
                 furthest_m > 0 ? left_m / furthest_m : 1, Relation::kAtMost, kReturnedShare);
  JudgeHoldsAll(judge);
}

void JudgeHanging(Judge* judge) {
  // A scene without the body has nothing that hangs.
  const std::optional<double> speed_m_s = judge->study().samples.back().speed_m_s;
  judge->AddLast("hangs", "speed at the end of the body that hangs", "m/s",
                 speed_m_s.value_or(std::numeric_limits<double>::infinity()), Relation::kAtMost,
                 kRestSpeedMS);
  JudgeHoldsAll(judge);
}

void JudgeStory(const PaperFigure& figure, Judge* judge) {
  const PaperStudy& study = judge->study();
  switch (figure.story) {
    case Story::kNone:
      return;
    case Story::kEndsTogether:
      judge->AddLast("together", "colliding particles at the end of a strong adhesive's run", "",
                     study.samples.back().colliding_particles, Relation::kAtLeast, 1);
      return;
    case Story::kEndsApart:
      judge->AddLast("met", "colliding particles, at most, before a weak adhesive lets go", "",
                     MostColliding(study), Relation::kAtLeast, 1);
      judge->AddLast("apart", "colliding particles at the end of a weak adhesive's run", "",
                     study.samples.back().colliding_particles, Relation::kIs, 0);
      return;
    case Story::kAggregates:
      JudgeAggregate(judge);
      return;
    case Story::kRolls:
      JudgeRolling(judge);
      return;
    case Story::kHoldsAll:
      JudgeHoldsAll(judge);
      return;
    case Story::kOneZone:
      judge->AddLast("one_zone", "bodies in the largest zone at the end, of all", "",
                     static_cast<double>(study.samples.back().zone_bodies) / study.bodies,
                     Relation::kIs, 1);
      return;
    case Story::kPulls:
      JudgePulling(judge);
      return;
    case Story::kHangs:
      JudgeHanging(judge);
      return;
  }
}

}  // namespace

Claim Judged(std::string id, std::string subject, std::string unit, double value, Relation relation,
             double limit) {
  return {std::move(id),
          std::move(subject),
          std::move(unit),
          value,
          relation,
          limit,
          Holds(value, relation, limit) ? Verdict::kHolds : Verdict::kFails};
}

std::vector<Claim> JudgeFigure(const PaperFigure& figure, const PaperStudy& study, bool whole) {
  Judge judge(study, whole);
  judge.Add("finite", "steps whose state was not finite", "", study.finite ? 0 : 1, Relation::kIs,
            0);
  if (figure.particles) {
    judge.Add("particles", "particles, as in the paper", "", study.particles, Relation::kIs,
              *figure.particles);
  }
  if (figure.triangles) {
    judge.Add("triangles", "triangles, as in the paper", "", study.triangles, Relation::kIs,
              *figure.triangles);
  }
  JudgeContact(&judge);
  JudgeConservation(&judge);
  JudgeOnset(&judge);
  JudgeStory(figure, &judge);
  return judge.Take();
}

std::string LimitText(const Claim& claim) {
  const char* relation = claim.relation == Relation::kAtMost    ? "at most "
                         : claim.relation == Relation::kAtLeast ? "at least "
                                                                : "exactly ";
  return absl::StrCat(relation, absl::StrFormat("%.4g", claim.limit), claim.unit.empty() ? "" : " ",
                      claim.unit);
}

}  // namespace adhesim
