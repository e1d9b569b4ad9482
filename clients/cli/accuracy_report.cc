#include "clients/cli/accuracy_report.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include <utility>

#include "core/model/frame.h"

namespace adhesim {
namespace {

Json NormsJson(const ErrorNorms& norms) {
  return {{"final", norms.final}, {"l2", norms.l2}, {"linf", norms.linf}};
}

Json ErrorJson(const AccuracyError& error) {
  Json json = {{"position_m", NormsJson(error.position_m)}};
  if (error.force_n) json["force_n"] = NormsJson(*error.force_n);
  if (!error.events.empty()) {
    json["worst_event_s"] = error.worst_event_s;
    json["lost_events"] = error.lost_events;
    for (const EventError& event : error.events) {
      Json one = {{"what", event.what}};
      if (event.reference_s) one["reference_s"] = *event.reference_s;
      if (event.error_s) one["error_s"] = *event.error_s;
      json["events"].push_back(std::move(one));
    }
  }
  for (const Observable& observable : error.observables) {
    json["observables"].push_back({{"name", observable.name},
                                   {"unit", observable.unit},
                                   {"value", observable.value},
                                   {"reference", observable.reference},
                                   {"share", observable.share}});
  }
  json["worst_share"] = error.worst_share;
  return json;
}

Json CostJson(const CostFigures& cost) {
  return {
      {"repeats", cost.repeats},
      {"wall_s_per_s", {{"min", cost.wall_min}, {"p50", cost.wall_p50}, {"p99", cost.wall_p99}}},
      {"cpu_s_per_s_min", cost.cpu_min},
      {"step_ms",
       {{"p50", cost.step_p50_ms}, {"p99", cost.step_p99_ms}, {"max", cost.step_max_ms}}}};
}

const char* KindName(DialKind kind) {
  switch (kind) {
    case DialKind::kNumerical:
      return "numerical";
    case DialKind::kMesh:
      return "mesh";
    case DialKind::kModel:
      return "model";
    case DialKind::kRival:
      return "rival";
  }
  return "";
}

Json EditsJson(const AccuracySetting& setting) {
  Json edits = Json::array();
  for (const SceneEdit& edit : setting.edits) edits.push_back(edit.path + "=" + edit.value);
  return edits;
}

Json PointJson(const AccuracyPoint& point) {
  Json json = {{"dial", point.dial},
               {"name", point.setting.name},
               {"kind", KindName(point.setting.kind)},
               {"integrator", IntegratorName(point.setting.integrator)},
               {"rate_hz", point.setting.rate_hz},
               {"settings", EditsJson(point.setting)},
               {"failed", !point.failed.empty()}};
  if (!point.failed.empty()) json["reason"] = point.failed;
  if (point.not_run) json["not_run"] = true;
  if (point.cost.repeats > 0) json["cost"] = CostJson(point.cost);
  if (point.substeps > 0) json["substeps"] = point.substeps;
  if (point.error) json["error"] = ErrorJson(*point.error);
  if (point.deflection_m) json["deflection_m"] = *point.deflection_m;
  if (const std::string bits = BitsText(point.bits); !bits.empty()) json["report"] = bits;
  return json;
}

Json ReferenceJson(const AccuracyReference& reference) {
  return {{"name", reference.name},
          {"rate_hz", reference.rate_hz},
          {"substeps", reference.substeps},
          {"wall_s_per_s", reference.wall}};
}

Json RecommendationJson(const AccuracyStudy& study) {
  const AdviceLimits& limits = study.limits;
  Json json = {{"by", limits.by_observables ? "observables" : "positions and forces"},
               {"tolerance_m", limits.tolerance_m},
               {"tolerance_n", limits.tolerance_n},
               {"tolerance_share", limits.tolerance_share},
               {"rate_hz", limits.rate_hz},
               {"step_budget", limits.step_share}};
  const auto add = [&](const char* name, int index) {
    if (index < 0) return;
    const AccuracySetting& setting = study.points[index].setting;
    json[name] = {{"point", index}, {"name", setting.name}, {"settings", EditsJson(setting)}};
  };
  add("cheapest", study.advice.cheapest);
  add("most_accurate", study.advice.most_accurate);
  json["text"] = AdviceText(study);
  return json;
}

// "0.12 mm, 3.4 mN, 1.2 times real time" of a point.
std::string Described(const AccuracyStudy& study, const AccuracyPoint& point) {
  std::string text = absl::StrCat(point.setting.name, ": ");
  if (study.limits.by_observables) {
    absl::StrAppend(&text,
                    absl::StrFormat("observables within %.2g %%", 100 * point.error->worst_share));
  } else {
    absl::StrAppend(&text, absl::StrFormat("%.3g mm", 1e3 * point.error->position_m.l2));
    if (point.error->force_n) {
      absl::StrAppend(&text, absl::StrFormat(", %.3g N", point.error->force_n->l2));
    }
  }
  absl::StrAppend(
      &text, absl::StrFormat(", %.3g s of wall time per simulated second", point.cost.wall_min));
  const std::string options = SetOptions(point.setting);
  return text + (options.empty() ? " (the scene as it is)" : " (" + options + ")");
}

std::string Tolerances(const AccuracyStudy& study) {
  const AdviceLimits& limits = study.limits;
  if (limits.by_observables) {
    return absl::StrFormat("%.3g %% of the observables", 100 * limits.tolerance_share);
  }
  std::string text = absl::StrFormat("%.3g mm", 1e3 * limits.tolerance_m);
  if (study.peak_force_n > 0)
    absl::StrAppend(&text, absl::StrFormat(" and %.3g N", limits.tolerance_n));
  return text;
}

// That the references themselves are further apart than what is demanded.
std::string BandText(const AccuracyStudy& study) {
  if (!study.band) {
    return "There is one reference only: nothing tells how far it is off.";
  }
  const AdviceLimits& limits = study.limits;
  const bool within = limits.by_observables ? study.band->worst_share <= limits.tolerance_share
                                            : study.band->position_m.l2 <= limits.tolerance_m &&
                                                  (!study.band->force_n ||
                                                   study.band->force_n->l2 <= limits.tolerance_n);
  if (within) return "";
  return "The two references differ by more than the tolerance: what is within it cannot be told "
         "for certain.";
}

}  // namespace

std::string SetOptions(const AccuracySetting& setting) {
  return absl::StrJoin(setting.edits, " ", [](std::string* out, const SceneEdit& edit) {
    absl::StrAppend(out, "--set ", edit.path, "=", edit.value);
  });
}

std::string BitsText(std::uint32_t bits) {
  std::vector<std::string> parts;
  for (const auto& [bit, text] : {std::pair(kStepNotConverged, "solver stopped at its limit"),
                                  std::pair(kStepSubstepLimit, "too fast for the sub-steps"),
                                  std::pair(kStepReleasePasses, "releases spilled into next steps"),
                                  std::pair(kStepBondCapacity, "contacts beyond capacity"),
                                  std::pair(kStepCandidateCapacity, "pairs beyond capacity"),
                                  std::pair(kStepVolumeNotMet, "volume not met"),
                                  std::pair(kStepZoneSplitForced, "zone split"),
                                  std::pair(kStepOverlap, "overlapping at the start")}) {
    if (bits & bit) parts.emplace_back(text);
  }
  return absl::StrJoin(parts, ", ");
}

std::vector<std::string> AdviceText(const AccuracyStudy& study) {
  std::vector<std::string> lines;
  if (study.advice.cheapest >= 0) {
    const AccuracyPoint& point = study.points[study.advice.cheapest];
    lines.push_back(
        absl::StrCat("Cheapest within ", Tolerances(study), ": ", Described(study, point), "."));
    const double p99 = 1e-3 * point.cost.step_p99_ms * point.setting.rate_hz;
    if (p99 > study.limits.step_share) {
      lines.push_back(absl::StrFormat(
          "It does not keep real time on this machine: the 99th percentile of its steps takes "
          "%.3g of a step's time, and %.3g is permitted.",
          p99, study.limits.step_share));
    }
  } else {
    lines.push_back(absl::StrCat("No setting that was run is within ", Tolerances(study), "."));
  }
  if (study.advice.most_accurate >= 0) {
    lines.push_back(
        absl::StrFormat("Most accurate at %.6g Hz or more, with steps in %.3g of their "
                        "time: %s.",
                        study.limits.rate_hz, study.limits.step_share,
                        Described(study, study.points[study.advice.most_accurate])));
  } else {
    lines.push_back(
        absl::StrFormat("No setting that was run keeps %.6g Hz with steps in %.3g of their time "
                        "on this machine.",
                        study.limits.rate_hz, study.limits.step_share));
  }
  if (const std::string band = BandText(study); !band.empty()) lines.push_back(band);
  if (study.own_mesh && study.own_mesh->position_m.l2 > study.limits.tolerance_m) {
    lines.push_back(absl::StrFormat(
        "The mesh is beside this: a mesh twice as fine differs by %.3g mm, which no setting of the "
        "step makes less.",
        1e3 * study.own_mesh->position_m.l2));
  }
  return lines;
}

Json AccuracyJson(const AccuracyReport& report) {
  const AccuracyStudy& study = report.study;
  const AboutMachine& machine = report.machine;
  Json json = {{"scene", study.scene},
               {"file", report.file},
               {"seconds", study.duration_s},
               {"instants", study.instants},
               {"probes", study.probes},
               {"bodies", study.bodies},
               {"particles", study.particles},
               {"tetrahedra", study.tetrahedra},
               {"rate_hz", study.rate_hz},
               {"motion_m", study.motion_m},
               {"chaotic", study.chaotic},
               {"judged_by", study.chaotic ? "observables" : "positions and forces"},
               {"reference", ReferenceJson(study.reference)}};
  if (study.peak_force_n > 0) json["peak_force_n"] = study.peak_force_n;
  if (study.second) json["second_reference"] = ReferenceJson(*study.second);
  json["references_share"] = study.references_share;
  if (study.band) json["band"] = ErrorJson(*study.band);
  if (study.formula) {
    json["formula"] = {{"text", study.formula->text},
                       {"deflection_m", study.formula->deflection_m},
                       {"reference_deflection_m", study.reference_deflection_m}};
  }
  if (study.finer_mesh) {
    json["finer_mesh"] = ReferenceJson(*study.finer_mesh);
    json["own_mesh"] = ErrorJson(*study.own_mesh);
  }
  if (!study.rival_about.empty()) json["rival"] = study.rival_about;
  for (const AccuracyDial& dial : study.dials) {
    Json one = {{"name", dial.name}, {"offered", dial.not_offered.empty()}};
    if (!dial.not_offered.empty()) one["reason"] = dial.not_offered;
    json["dials"].push_back(std::move(one));
  }
  for (const AccuracyPoint& point : study.points) json["points"].push_back(PointJson(point));
  json["orders"] = Json::array();
  for (const AccuracyOrder& order : study.orders) {
    json["orders"].push_back(
        {{"method", order.method}, {"order", order.fit.order}, {"points", order.points}});
  }
  json["recommendation"] = RecommendationJson(study);
  json["left_out"] = study.left_out;
  json["machine"] = {{"processor", machine.processor},
                     {"cores", machine.cores},
                     {"load", machine.load},
                     {"version", machine.version},
                     {"build", machine.build},
                     {"commit", machine.commit},
                     {"date", machine.date}};
  return json;
}

std::string AccuracyText(const AccuracyReport& report) {
  const AccuracyStudy& study = report.study;
  std::string text = absl::StrFormat("%s, %.4g s; reference: %s\n", study.scene, study.duration_s,
                                     study.reference.name);
  if (study.second) {
    absl::StrAppend(&text, absl::StrFormat("second reference: %s, %.3g mm away%s\n",
                                           study.second->name, 1e3 * study.band->position_m.l2,
                                           study.chaotic ? ": observables are judged" : ""));
  }
  absl::StrAppend(&text, absl::StrFormat("%-44s %10s %10s %9s %10s\n", "setting", "mm", "N",
                                         "share", "s per s"));
  for (const AccuracyPoint& point : study.points) {
    const std::string name = absl::StrCat(point.dial, ": ", point.setting.name);
    if (!point.failed.empty() || point.not_run) {
      absl::StrAppend(&text, absl::StrFormat("%-44s %s\n", name,
                                             point.not_run ? "not run: no time left"
                                                           : "FAILED: " + point.failed));
      continue;
    }
    const auto number = [](bool there, double value) {
      return there ? absl::StrFormat("%.3g", value) : std::string("-");
    };
    const bool measured = point.error.has_value();
    const bool force = measured && point.error->force_n.has_value();
    absl::StrAppend(
        &text, absl::StrFormat("%-44s %10s %10s %9s %10.3g\n", name,
                               number(measured, measured ? 1e3 * point.error->position_m.l2 : 0),
                               number(force, force ? point.error->force_n->l2 : 0),
                               number(measured, measured ? point.error->worst_share : 0),
                               point.cost.wall_min));
  }
  for (const AccuracyOrder& order : study.orders) {
    absl::StrAppend(&text, absl::StrFormat("order of %s: %.3g, of %d steps\n", order.method,
                                           order.fit.order, order.points));
  }
  for (const std::string& line : AdviceText(study)) absl::StrAppend(&text, line, "\n");
  if (!study.left_out.empty()) {
    absl::StrAppend(&text, "left out: ", absl::StrJoin(study.left_out, "; "), "\n");
  }
  return text;
}

}  // namespace adhesim
