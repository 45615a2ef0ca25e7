#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <diracstep/command/files/checkpoint_file.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/input_file.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/reports/build_facts.hpp>
#include <diracstep/reports/json.hpp>

namespace diracstep {

namespace {

constexpr std::string_view magic = "diracstep checkpoint 2\n";
constexpr std::size_t sum_size = sizeof(std::uint64_t);

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Misuse(fmt::format("'{}' is no checkpoint that can be used: {}", path, why));
}

/// The bytes between the first line and the check sum.
std::string_view checked_body(std::string_view bytes, const std::string& path) {
  if (bytes.substr(0, magic.size()) != magic)
    refuse(path, fmt::format("it does not begin with '{}'", magic.substr(0, magic.size() - 1)));
  if (bytes.size() < magic.size() + sum_size) refuse(path, "it is cut off");
  const std::string_view summed = bytes.substr(0, bytes.size() - sum_size);
  std::uint64_t sum = 0;
  std::memcpy(&sum, bytes.data() + summed.size(), sum_size);
  if (sum != check_sum(summed)) refuse(path, "its check sum is wrong, so it is damaged or cut off");
  return summed.substr(magic.size());
}

long count(const Json& json, const char* key) {
  if (!json.at(key).is_number_integer()) throw std::out_of_range(fmt::format("{} is no whole number", key));
  const auto value = json.at(key).get<std::int64_t>();
  if (value < 0) throw std::out_of_range(fmt::format("{} = {}", key, value));
  return value;
}

}  // namespace

std::uint64_t check_sum(std::string_view bytes) {
  std::uint64_t sum = 14695981039346656037U;
  for (const char c : bytes) sum = (sum ^ static_cast<unsigned char>(c)) * 1099511628211U;
  return sum;
}

std::string encoded(const Checkpoint& checkpoint) {
  const std::string state = checkpoint.state.bytes();
  Json json{{"run", Json::object()}, {"points", checkpoint.points}, {"bytes", checkpoint.bytes}};
  for (const auto& [key, value] : checkpoint.run) json["run"][key] = value;
  json["state"] = state.size();
  std::string text(magic);
  text += to_text(json) + '\n';
  text += state;
  const std::uint64_t sum = check_sum(text);
  return text.append(reinterpret_cast<const char*>(&sum), sum_size);
}

Checkpoint decoded(std::string_view bytes, const std::string& path) {
  const std::string_view body = checked_body(bytes, path);
  const std::size_t line = std::min(body.find('\n'), body.size());
  const std::string_view rest = body.substr(std::min(line + 1, body.size()));
  Checkpoint checkpoint;
  try {
    const Json json = Json::parse(body.substr(0, line));
    for (const auto& [key, value] : json.at("run").items())
      checkpoint.run.emplace_back(key, value.get<std::string>());
    checkpoint.points = count(json, "points");
    checkpoint.bytes = count(json, "bytes");
    const auto size = static_cast<std::size_t>(count(json, "state"));
    if (size != rest.size())
      refuse(path, fmt::format("{} bytes of state are announced, {} follow", size, rest.size()));
    checkpoint.state = Snapshot::from_bytes(rest);
  } catch (const Json::exception& error) {
    refuse(path, error.what());
  } catch (const std::out_of_range& error) {
    refuse(path, error.what());
  } catch (const Misuse& error) {
    refuse(path, error.what());
  }
  return checkpoint;
}

void write_checkpoint(const std::string& path, const Checkpoint& checkpoint) {
  replace_file(path, encoded(checkpoint));
}

Checkpoint read_checkpoint(const std::string& path) {
  return decoded(read_file(path, "the checkpoint", largest_checkpoint), path);
}

void require_same_run(const Checkpoint& saved, const std::vector<std::pair<std::string, std::string>>& run,
                      const std::string& path) {
  const auto value = [](const auto& list, const std::string& key) {
    for (const auto& [name, text] : list)
      if (name == key) return text;
    return std::string("nothing");
  };
  std::string differences;
  const auto compare = [&](const std::string& key) {
    const std::string there = value(saved.run, key), here = value(run, key);
    if (there == here || there == unknown_fact || here == unknown_fact) return;
    differences += fmt::format("\n  its {} is {}, here it is {}", key, there, here);
  };
  for (const auto& [key, text] : run) compare(key);
  for (const auto& [key, text] : saved.run)
    if (std::ranges::find(run, key, &std::pair<std::string, std::string>::first) == run.end()) compare(key);
  if (!differences.empty()) throw Misuse(fmt::format("'{}' is of another run:{}", path, differences));
}

}  // namespace diracstep
