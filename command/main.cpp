#include <cxxabi.h>
#include <unistd.h>

#include <cstdlib>
#include <diracstep/command/command_line.hpp>
#include <diracstep/command/interrupt.hpp>
#include <exception>
#include <new>
#include <string_view>
#include <typeinfo>

namespace {

/// Where memory is short, destructors of the JSON and TOML libraries take some and throw, and nobody can
/// catch that.
[[noreturn]] void end_without_memory() {
  const std::type_info* const thrown = abi::__cxa_current_exception_type();
  if (thrown == nullptr || *thrown != typeid(std::bad_alloc)) std::abort();
  constexpr std::string_view message =
      "diracstep: there is not enough memory; the files stand as they were last written\n";
  static_cast<void>(!write(STDERR_FILENO, message.data(), message.size()));
  _exit(1);
}

}  // namespace

int main(int count, char** arguments) {
  std::set_terminate(end_without_memory);
  diracstep::command::prepare_standard_streams();
  return diracstep::command::execute(count, arguments);
}
