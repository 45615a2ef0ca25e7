#include <diracstep/command/command_line.hpp>
#include <diracstep/command/interrupt.hpp>

int main(int count, char** arguments) {
  diracstep::command::prepare_standard_streams();
  return diracstep::command::execute(count, arguments);
}
