#include "core/study/accuracy_error.h"

#include <absl/strings/match.h>

#include <algorithm>
#include <cmath>

namespace adhesim {
namespace {

using Instants = std::vector<std::vector<Vec3>>;

ErrorNorms NormsOf(const Instants& a, const Instants& b) {
  ErrorNorms norms;
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    double mean_sq = 0;
    for (std::size_t k = 0; k < a[i].size(); ++k) {
      const double distance_sq = (a[i][k] - b[i][k]).squaredNorm();
      mean_sq += distance_sq / static_cast<double>(a[i].size());
      norms.linf = std::max(norms.linf, std::sqrt(distance_sq));
    }
    norms.final = std::sqrt(mean_sq);
    sum += mean_sq / static_cast<double>(a.size());
  }
  norms.l2 = std::sqrt(sum);
  return norms;
}

const ContactEvent* Find(const std::vector<ContactEvent>& events, const std::string& what) {
  const auto found = std::find_if(events.begin(), events.end(),
                                  [&](const ContactEvent& event) { return event.what == what; });
  return found == events.end() ? nullptr : &*found;
}

void CompareEvents(const AccuracyTrace& trace, const AccuracyTrace& truth, AccuracyError* error) {
  for (const ContactEvent& reference : truth.events) {
    const ContactEvent* event = Find(trace.events, reference.what);
    EventError& one = error->events.emplace_back();
    one.what = reference.what;
    one.reference_s = reference.time_s;
    if (event == nullptr) {
      ++error->lost_events;
      continue;
    }
    one.error_s = event->time_s - reference.time_s;
    error->worst_event_s = std::max(error->worst_event_s, std::abs(*one.error_s));
  }
  for (const ContactEvent& event : trace.events) {
    if (Find(truth.events, event.what) != nullptr) continue;
    error->events.push_back({event.what, std::nullopt, std::nullopt});
    ++error->lost_events;
  }
}

double Last(const std::vector<double>& values) { return values.empty() ? 0 : values.back(); }

// Of the events that end a contact; 0: none does.
double LastRelease(const AccuracyTrace& trace) {
  double last_s = 0;
  for (const ContactEvent& event : trace.events) {
    if (absl::EndsWith(event.what, " part") || absl::EndsWith(event.what, " lets go")) {
      last_s = std::max(last_s, event.time_s);
    }
  }
  return last_s;
}

// `scale` is what a difference is relative to; 0: the scene does not have the observable.
void AddObservable(const std::string& name, const std::string& unit, double value, double reference,
                   double scale, AccuracyError* error) {
  if (!(scale > 0)) return;
  const double share = std::abs(value - reference) / scale;
  error->observables.push_back({name, unit, value, reference, share});
  error->worst_share = std::max(error->worst_share, share);
}

void CompareObservables(const AccuracyTrace& trace, const AccuracyTrace& truth,
                        AccuracyError* error) {
  const double radius = Last(truth.radius_m);
  AddObservable("radius of gyration at the end", "m", Last(trace.radius_m), radius, radius, error);
  // A share is its own scale: 1 is every particle.
  const double colliding = Last(truth.colliding_share);
  if (colliding > 0 || Last(trace.colliding_share) > 0) {
    AddObservable("colliding particles' share at the end", "", Last(trace.colliding_share),
                  colliding, 1, error);
  }
  const double peak = PeakForce(truth);
  AddObservable("peak force", "N", PeakForce(trace), peak, peak, error);
  if (LastRelease(truth) > 0) {
    AddObservable("last release", "s", LastRelease(trace), LastRelease(truth), truth.time_s.back(),
                  error);
  }
}

}  // namespace

AccuracyError Compare(const AccuracyTrace& trace, const AccuracyTrace& truth) {
  AccuracyError error;
  error.position_m = NormsOf(trace.position_m, truth.position_m);
  if (!truth.force_n.empty() && !truth.force_n[0].empty()) {
    error.force_n = NormsOf(trace.force_n, truth.force_n);
  }
  CompareEvents(trace, truth, &error);
  CompareObservables(trace, truth, &error);
  return error;
}

double MotionOf(const AccuracyTrace& trace, std::span<const Vec3> rest_m) {
  const Instants start(trace.position_m.size(), std::vector<Vec3>(rest_m.begin(), rest_m.end()));
  return NormsOf(trace.position_m, start).l2;
}

double PeakForce(const AccuracyTrace& trace) {
  double peak_n = 0;
  for (const std::vector<Vec3>& tools : trace.force_n) {
    for (const Vec3& force : tools) peak_n = std::max(peak_n, force.norm());
  }
  return peak_n;
}

std::optional<FittedOrder> FitOrder(std::span<const double> dt_s, std::span<const double> error) {
  if (dt_s.size() < 3 || dt_s.size() != error.size()) return std::nullopt;
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t k = 0; k < dt_s.size(); ++k) {
    if (!(error[k] > 0) || !(dt_s[k] > 0)) return std::nullopt;
    const double x = std::log(dt_s[k]), y = std::log(error[k]);
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  const auto n = static_cast<double>(dt_s.size());
  const double spread = n * sxx - sx * sx;
  if (!(spread > 0)) return std::nullopt;
  const double order = (n * sxy - sx * sy) / spread;
  return FittedOrder{order, std::exp((sy - order * sx) / n)};
}

}  // namespace adhesim
