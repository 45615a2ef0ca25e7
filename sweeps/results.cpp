#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/files/shown_text.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/sweeps/results.hpp>
#include <diracstep/sweeps/sweep_page.hpp>
#include <filesystem>
#include <limits>

namespace diracstep {

namespace {

constexpr std::size_t status_bytes = 7;  // of "doubted"
constexpr std::size_t most_reasons = 5;
constexpr std::array<const char*, 3> status_names{"ok", "doubted", "failed"};

std::string field(double value) { return std::isnan(value) ? "" : fmt::format("{:.17g}", value); }

/// Of results.csv, all but the reason.
std::vector<std::string> column_names(const Sweep& sweep) {
  std::vector<std::string> names{"member"};
  const std::vector<std::string> varied = sweep.names(), recorded = recorded_names(sweep);
  names.insert(names.end(), varied.begin(), varied.end());
  names.insert(names.end(), {"status", "t"});
  names.insert(names.end(), recorded.begin(), recorded.end());
  return names;
}

std::string python_text(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' || c == '\\' ? std::string("\\") + c : std::string(1, c);
  return quoted + "'";
}

/// The head of a .npy file, version 2 of its format, of a structured array: numpy.lib.format.
std::string npy_head(const Sweep& sweep, long members) {
  std::string kinds;
  for (const std::string& name : column_names(sweep))
    kinds += fmt::format("({}, '{}'), ", python_text(name),
                         name == "member"   ? std::string("<i8")
                         : name == "status" ? fmt::format("|S{}", status_bytes)
                                            : std::string("<f8"));
  std::string text =
      fmt::format("{{'descr': [{}], 'fortran_order': False, 'shape': ({},), }}", kinds, members);
  constexpr std::size_t before = 12, unit = 64;
  text.append(unit - 1 - (before + text.size()) % unit, ' ');
  text += '\n';
  std::string head("\x93NUMPY\x02\x00", 8);
  for (unsigned k = 0; k < 4; ++k) head += static_cast<char>((text.size() >> (8 * k)) & 0xffu);
  return head + text;
}

/// As the file format asks, the lowest byte first.
void put_bytes(std::string& bytes, std::uint64_t value) {
  for (unsigned k = 0; k < 8; ++k) bytes += static_cast<char>((value >> (8 * k)) & 0xffu);
}

void put_number(std::string& bytes, double value) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  put_bytes(bytes, bits);
}

double number_of(std::string_view text) {
  double value = std::numeric_limits<double>::quiet_NaN();
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// A file that takes its name when it is whole.
class GrowingFile {
 public:
  explicit GrowingFile(std::string path)
      : path_(std::move(path)), file_(path_ + ".part", OutputFile::Mode::fresh) {}
  OutputFile& file() { return file_; }
  void finish() {
    file_.sync();
    file_.close();
    std::filesystem::rename(path_ + ".part", path_);
    sync_folder(std::filesystem::path(path_).parent_path().string());
  }

 private:
  std::string path_;
  OutputFile file_;
};

/// Reads the lines of members one after the other.
class Gathered {
 public:
  Gathered(const Sweep& sweep, SweepReport& report)
      : sweep_(sweep), varied_(sweep.names().size()), report_(report), page_(page_names(sweep)) {
    report.ok = report.doubted = report.failed = 0;
    report.reasons.clear();
    report.columns.clear();
    names_ = column_names(sweep);
    for (std::size_t k = varied_ + 2; k < names_.size(); ++k)
      report.columns.push_back({names_[k], 0, HUGE_VAL, 0.0, -HUGE_VAL});
  }

  /// The bytes of the line in results.npy.
  std::string take(const std::string& line) {
    std::string bytes;
    std::vector<double> numbers;
    std::size_t at = 0;
    for (std::size_t k = 0; k < names_.size(); ++k) {
      const std::size_t end = std::min(line.find(',', at), line.size());
      const std::string_view text = std::string_view(line).substr(at, end - at);
      at = std::min(end + 1, line.size());
      if (k == 0) {
        long long member = 0;
        std::from_chars(text.data(), text.data() + text.size(), member);
        put_bytes(bytes, static_cast<std::uint64_t>(member));
      } else if (k == varied_ + 1) {
        bytes += std::string(text) + std::string(status_bytes - text.size(), '\0');
        count(text, line);
      } else {
        const double value = number_of(text);
        put_number(bytes, value);
        numbers.push_back(value);
        if (k > varied_ + 1) add(report_.columns[k - varied_ - 2], value);
      }
    }
    page_.take(numbers);
    return bytes;
  }

  std::string page() const { return page_.page(sweep_, report_); }

  void end() {
    for (SweepColumn& column : report_.columns) {
      if (column.count == 0) column.least = column.most = std::numeric_limits<double>::quiet_NaN();
      column.mean /= static_cast<double>(column.count);
    }
  }

 private:
  void count(std::string_view status, const std::string& line) {
    if (status == status_names[0]) {
      ++report_.ok;
      return;
    }
    ++(status == status_names[1] ? report_.doubted : report_.failed);
    if (report_.reasons.size() < most_reasons)
      report_.reasons.push_back("member " + line.substr(0, line.find(',')) + ", " + std::string(status) +
                                ": " + reason(line));
  }

  /// The last field, without the quotes around it.
  std::string reason(const std::string& line) const {
    std::size_t at = 0;
    for (std::size_t k = 0; k < names_.size(); ++k) at = line.find(',', at) + 1;
    std::string text = line.substr(at);
    if (text.size() >= 2 && text.front() == '"') text = text.substr(1, text.size() - 2);
    return text;
  }

  static void add(SweepColumn& column, double value) {
    if (std::isnan(value)) return;
    ++column.count;
    column.least = std::min(column.least, value);
    column.most = std::max(column.most, value);
    column.mean += value;
  }

  /// All numbers but that of the member.
  static std::vector<std::string> page_names(const Sweep& sweep) {
    std::vector<std::string> names;
    for (const std::string& name : column_names(sweep))
      if (name != "member" && name != "status") names.push_back(name);
    return names;
  }

  const Sweep& sweep_;
  std::size_t varied_;
  SweepReport& report_;
  PageData page_;
  std::vector<std::string> names_;
};

}  // namespace

std::string result_line(const Sweep& sweep, long member, const MemberResult& result) {
  std::string line = fmt::format("{}", member);
  for (const double value : sweep.member(member)) line += ',' + field(value);
  line += fmt::format(",{},{}", status_names[static_cast<std::size_t>(result.status)], field(result.time));
  for (const double value : result.numbers) line += ',' + field(value);
  return line + ',' + csv_field(shown_line(result.reason));
}

std::optional<long> gather_results(const Sweep& sweep, const BlockFiles& blocks, const std::string& folder,
                                   SweepReport& report) {
  const std::string stem = (std::filesystem::path(folder) / "results").string();
  GrowingFile csv(stem + ".csv"), npy(stem + ".npy");
  std::string header;
  for (const std::string& name : column_names(sweep)) header += csv_field(name) + ',';
  csv.file().write(header + "reason\n");
  npy.file().write(npy_head(sweep, sweep.members()));
  Gathered gathered(sweep, report);
  for (long k = 0; k < blocks.count(); ++k) {
    const std::vector<std::string> lines = blocks.read(k);
    if (static_cast<long>(lines.size()) != blocks.size(k)) return k;
    std::string text, bytes;
    for (const std::string& line : lines) {
      text += line + '\n';
      bytes += gathered.take(line);
    }
    csv.file().write(text);
    npy.file().write(bytes);
  }
  gathered.end();
  csv.finish();
  npy.finish();
  replace_file((std::filesystem::path(folder) / "report.html").string(), gathered.page());
  return std::nullopt;
}

}  // namespace diracstep
