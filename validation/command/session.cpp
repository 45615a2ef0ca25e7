#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <diracstep/validation/command/session.hpp>
#include <stdexcept>

namespace diracstep::command {

namespace {

[[noreturn]] void refuse_output() {
  throw std::runtime_error(
      fmt::format("standard output could not be written in full: {}", std::strerror(errno)));
}

}  // namespace

void say(std::string_view message) { fmt::print(stderr, "diracstep: {}\n", message); }

void print(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) refuse_output();
}

void finish_output() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) refuse_output();
}

}  // namespace diracstep::command
