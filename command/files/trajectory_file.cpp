#include <fmt/format.h>

#include <diracstep/command/files/trajectory_file.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <exception>
#include <iterator>

namespace diracstep::command {

namespace {

constexpr std::size_t max_waiting = 1 << 16;  // bytes gathered before they are written

std::string header(const Scene& scene, const std::vector<Output>& further) {
  std::string line = "t";
  for (const auto& name : position_names(scene)) line += ',' + csv_field(name);
  for (const char* prefix : {"v_", "p_"})
    for (const auto& name : scene.coordinates) line += ',' + csv_field(prefix + name);
  for (const auto& name : scene.row_names()) line += ',' + csv_field("lambda_" + name);
  line += ",energy";
  for (const Output& column : further) line += ',' + csv_field(column.name);
  return line + '\n';
}

OutputFile opened(const std::string& path, OutputFile::Mode mode) {
  try {
    if (path == standard_output) return OutputFile::on_standard_output();
    return {path, mode};
  } catch (const Misuse& misuse) {
    throw Misuse(fmt::format("--out: {}", misuse.what()));
  }
}

}  // namespace

TrajectoryFile::TrajectoryFile(const std::string& path, const Scene& scene, std::vector<Output> further)
    : rows_(scene.rows()), further_(std::move(further)), file_(opened(path, OutputFile::Mode::fresh)) {
  put(header(scene, further_));
}

TrajectoryFile::TrajectoryFile(const std::string& path, const Scene& scene, Mark mark,
                               std::vector<Output> further)
    : rows_(scene.rows()),
      further_(std::move(further)),
      file_(opened(path, OutputFile::Mode::existing)),
      mark_(mark) {
  const std::string expected = header(scene, further_);
  if (file_.size() < mark.bytes || mark.bytes < static_cast<long>(expected.size()))
    throw Misuse(
        fmt::format("--out: '{}' has {} bytes; at the checkpoint it had {}", path, file_.size(), mark.bytes));
  if (file_.beginning(static_cast<long>(expected.size())) != expected)
    throw Misuse(fmt::format("--out: '{}' does not begin with the columns of this scene", path));
  file_.cut(mark.bytes);
}

TrajectoryFile::~TrajectoryFile() {
  try {
    flush();
  } catch (const std::exception&) {  // the exception that ends the run says more
  }
}

void TrajectoryFile::write(const Sample& sample) {
  if (!forces_) return write_shown(sample);
  Sample shown = sample;
  shown.lambda = forces_(sample);
  write_shown(shown);
}

void TrajectoryFile::write_shown(const Sample& sample) {
  std::string line = fmt::format("{:.17g}", sample.time);
  const auto add = [&line](const auto& column) {
    for (const double value : column) fmt::format_to(std::back_inserter(line), ",{:.17g}", value);
  };
  for (const Vector* column : {&sample.q, &sample.v, &sample.p}) add(*column);
  add(sample.lambda.head(rows_));
  fmt::format_to(std::back_inserter(line), ",{:.17g}", sample.energy);
  for (const Output& column : further_)
    fmt::format_to(std::back_inserter(line), ",{:.17g}", column.at(sample.point()));
  put(line += '\n');
  ++mark_.lines;
}

void TrajectoryFile::close() {
  sync();
  file_.close();
}

TrajectoryFile::Mark TrajectoryFile::sync() {
  flush();
  file_.sync();
  return mark_;
}

void TrajectoryFile::put(const std::string& line) {
  if (waiting_.size() + line.size() > max_waiting) flush();
  waiting_ += line;
  mark_.bytes += static_cast<long>(line.size());
}

void TrajectoryFile::flush() {
  file_.write(waiting_);
  waiting_.clear();
}

}  // namespace diracstep::command
