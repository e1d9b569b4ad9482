#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "clients/cli/about_machine.h"
#include "clients/cli/bullet_stress.h"
#include "clients/cli/output.h"
#include "core/study/stress_cases.h"

namespace adhesim {

// One cell of the matrix, as it is kept in a file.
struct StressCell {
  std::string stress_case, variant;  // StressCase::name, VariantName()
  std::string outcome;               // OutcomeName(), or kNotExpressible
  std::string cause;                 // of what is not survived
  std::string commit;                // with which it was run
  Json figures;
};

// Of Bullet's cells: it does not have what the case is about.
inline constexpr char kNotExpressible[] = "not expressible";

struct TortureReport {
  std::uint64_t first_seed = 0;
  int scenes = 0, survived = 0, refused = 0;
  double simulated_s = 0, cpu_s = 0;
  struct Failure {
    std::uint64_t seed;
    std::string cause, file;
  };
  std::vector<Failure> failures;
};

struct StressReport {
  AboutMachine machine;
  std::vector<StressCell> cells;
  std::vector<StressCell> bullet;  // the same cases in Bullet, at kBulletVariants
  TortureReport torture;           // no scenes: it was not asked for

  // Among `cells`, or those of Bullet where the variant is one of its own.
  const StressCell* Find(std::string_view stress_case, std::string_view variant) const;
  // How many of our cells have an outcome.
  int Count(std::string_view outcome) const;
  // How many of Bullet's cells of a variant have.
  int CountBullet(std::string_view variant, std::string_view outcome) const;
  // Those of kBulletVariants that were run, by name.
  std::vector<std::string> BulletVariants() const;
};

// Steps that Bullet is given: ours of the scene, and a short one, which does more for it than
// anything else.
struct BulletVariant {
  const char* name;
  std::optional<double> dt_s;
};
inline constexpr BulletVariant kBulletVariants[] = {{"Bullet", std::nullopt},
                                                    {"Bullet, 1 ms", 0.001}};

StressCell CellOf(const StressCase& stress_case, const StressVariant& variant,
                  const StressResult& result, const std::string& commit);

StressCell BulletCellOf(const StressCase& stress_case, const BulletVariant& variant,
                        const BulletCase& bullet_case, const std::string& commit);

// {"cells": [...], "counts": {...}, "bullet": {...}, "machine": {...}, "torture": {...}}.
Json StressJson(const StressReport& report);
// The cells of a file that StressJson() wrote, ours and Bullet's. NotFound: there is no such file;
// InvalidArgument: it is another.
absl::StatusOr<StressReport> ReadStressCells(const std::string& path);
// Whether WriteStressFile() can write there; the file stays as it is. Errors: InvalidArgument.
absl::Status CheckReplaceable(const std::string& path);
// Replaces the file at once, so that a run that is broken off leaves a whole one.
absl::Status WriteStressFile(const std::string& path, const std::string& text);

// One line a cell for people.
std::string StressLine(const StressCell& cell);

// A page that stands alone: counts, the matrix in colours, what is not survived and why, figures.
std::string StressPage(const StressReport& report);

}  // namespace adhesim
