#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iostream>
#include <string>
#include <string_view>
#include <vector>

#include "adhesim/v1/frame.pb.h"

namespace adhesim {

// A scripted motion of a tool's tip: rows of t_s,x_m,y_m,z_m,qw,qx,qy,qz, in between linear.
class Trajectory {
 public:
  // Prints what is wrong with the file, as file:line: error, and is empty then.
  static Trajectory Read(const std::string& file);

  bool empty() const { return rows_.empty(); }
  double begin_s() const { return rows_.front()[0]; }
  double end_s() const { return rows_.back()[0]; }

  // The pose at a time; held before the beginning and after the end.
  v1::Pose At(double t_s) const;

 private:
  static constexpr char kHeader[] = "t_s,x_m,y_m,z_m,qw,qx,qy,qz";
  using Row = std::array<double, 8>;

  // Why a line is no row, or nothing.
  static std::string Parse(std::string_view line, Row* row);

  std::vector<Row> rows_;
};

inline std::string Trajectory::Parse(std::string_view line, Row* row) {
  for (std::size_t i = 0; i < row->size(); ++i) {
    const std::size_t comma = line.find(',');
    if ((comma == line.npos) != (i + 1 == row->size())) {
      return "expected 8 numbers: " + std::string(kHeader);
    }
    std::string_view cell = line.substr(0, comma);
    while (cell.starts_with(' ')) cell.remove_prefix(1);
    while (cell.ends_with(' ')) cell.remove_suffix(1);
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), (*row)[i]);
    if (error != std::errc() || end != cell.data() + cell.size() || !std::isfinite((*row)[i])) {
      return "'" + std::string(cell) + "' is not a finite number";
    }
    line.remove_prefix(comma == line.npos ? line.size() : comma + 1);
  }
  const double norm =
      std::hypot(std::hypot((*row)[4], (*row)[5]), std::hypot((*row)[6], (*row)[7]));
  if (std::abs(norm - 1) > 0.01) return "the quaternion's norm must be 1 within 0.01";
  return "";
}

inline Trajectory Trajectory::Read(const std::string& file) {
  Trajectory result;
  std::ifstream in(file);
  if (!in) {
    std::cerr << file << ": error: cannot be read\n";
    return result;
  }
  std::string line;
  bool ok = true;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.ends_with('\r')) line.pop_back();
    if (line.empty() || line[0] == '#' || (number == 1 && line == kHeader)) continue;
    Row row{};
    std::string wrong = Parse(line, &row);
    if (wrong.empty() && !result.rows_.empty() && row[0] <= result.rows_.back()[0]) {
      wrong = "times must increase";
    }
    if (!wrong.empty()) {
      std::cerr << file << ":" << number << ": error: " << wrong << "\n";
      ok = false;
    } else {
      result.rows_.push_back(row);
    }
  }
  if (ok && result.rows_.empty()) std::cerr << file << ": error: no rows: " << kHeader << "\n";
  if (!ok) result.rows_.clear();
  return result;
}

inline v1::Pose Trajectory::At(double t_s) const {
  std::size_t next = 0;
  while (next < rows_.size() && rows_[next][0] <= t_s) ++next;
  const Row& a = rows_[next == 0 ? 0 : next - 1];
  const Row& b = rows_[next == rows_.size() ? next - 1 : next];
  const double w = b[0] > a[0] ? std::clamp((t_s - a[0]) / (b[0] - a[0]), 0.0, 1.0) : 0.0;
  // q and -q are the same rotation: the shorter way round.
  const double dot = a[4] * b[4] + a[5] * b[5] + a[6] * b[6] + a[7] * b[7];
  const double sign = dot < 0 ? -1 : 1;
  Row row{};
  for (int i = 1; i < 8; ++i) row[i] = (1 - w) * a[i] + w * (i >= 4 ? sign : 1) * b[i];
  const double norm = std::hypot(std::hypot(row[4], row[5]), std::hypot(row[6], row[7]));
  v1::Pose pose;
  pose.set_x_m(row[1]);
  pose.set_y_m(row[2]);
  pose.set_z_m(row[3]);
  pose.set_qw(row[4] / norm);
  pose.set_qx(row[5] / norm);
  pose.set_qy(row[6] / norm);
  pose.set_qz(row[7] / norm);
  return pose;
}

}  // namespace adhesim
