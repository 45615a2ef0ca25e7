#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <diracstep/core/errors.hpp>
#include <diracstep/validation/command/trajectory_file.hpp>
#include <diracstep/validation/report.hpp>
#include <stdexcept>

namespace diracstep::command {

namespace {

std::string header(const Scene& scene) {
  std::string line = "t";
  for (const char* prefix : {"", "v_", "p_"})
    for (const auto& name : scene.coordinates) line += ',' + csv_field(prefix + name);
  for (const auto& name : scene.row_names()) line += ',' + csv_field("lambda_" + name);
  return line + ",energy\n";
}

}  // namespace

TrajectoryFile::TrajectoryFile(const std::string& path, const Scene& scene)
    : rows_(scene.rows()), path_(path), file_(std::fopen(path.c_str(), "w")) {
  if (!file_) throw Misuse(fmt::format("--out: '{}' cannot be written: {}", path, std::strerror(errno)));
  put(header(scene));
}

void TrajectoryFile::write(const Sample& sample) {
  std::string line = fmt::format("{:.17g}", sample.time);
  const auto add = [&line](const auto& column) {
    for (const double value : column) line += fmt::format(",{:.17g}", value);
  };
  for (const Vector* column : {&sample.q, &sample.v, &sample.p}) add(*column);
  add(sample.lambda.head(rows_));
  put(line + fmt::format(",{:.17g}\n", sample.energy));
  ++lines_;
}

void TrajectoryFile::close() {
  if (!file_) return;
  const bool flushed = std::fflush(file_.get()) == 0;
  const int error = errno;
  if (std::fclose(file_.release()) == 0 && flushed) return;
  if (!flushed) errno = error;
  refuse();
}

void TrajectoryFile::put(const std::string& line) {
  if (std::fwrite(line.data(), 1, line.size(), file_.get()) != line.size()) refuse();
}

void TrajectoryFile::refuse() const {
  throw std::runtime_error(fmt::format("'{}' could not be written in full: {}", path_, std::strerror(errno)));
}

}  // namespace diracstep::command
