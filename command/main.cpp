#include <diracstep/command/command_line.hpp>
#include <diracstep/command/interrupt.hpp>

int main(int count, char** arguments) {
  diracstep::command::catch_interrupts();
  return diracstep::command::execute(count, arguments);
}
