#include <diracstep/validation/command/command_line.hpp>
#include <diracstep/validation/command/interrupt.hpp>

int main(int count, char** arguments) {
  diracstep::command::catch_interrupts();
  return diracstep::command::execute(count, arguments);
}
