#include <diracstep/version.h>

#include <atomic>
#include <deque>
#include <diracstep/c_interface/handles.hpp>

using namespace diracstep;

namespace diracstep::c_interface {

namespace {

/// What C reads of the last calls of a thread.
struct Answers {
  std::string message;
  std::deque<std::string> texts;   ///< of keep(text) in this call
  std::vector<std::string> cells;  ///< of the table
  std::vector<const char*> cell_pointers;
  std::vector<std::shared_ptr<const void>> others;
};

Answers& answers() {
  thread_local Answers kept;
  return kept;
}

int told(int code, const char* message) noexcept {
  try {
    answers().message = message;
  } catch (...) {
    return code;  // without memory for the message the code must do
  }
  return code;
}

}  // namespace

int code_of_exception() noexcept {
  try {
    throw;
  } catch (const Interruption& interruption) {
    return told(DIRACSTEP_INTERRUPTED, interruption.what());
  } catch (const Misuse& misuse) {
    return told(DIRACSTEP_MISUSE, misuse.what());
  } catch (const std::exception& error) {
    return told(DIRACSTEP_FAILED, error.what());
  } catch (...) {
    return told(DIRACSTEP_FAILED, "something was thrown that is no std::exception");
  }
}

void begin_call() noexcept {
  answers().texts.clear();
  answers().others.clear();
}

const char* keep(std::string text) {
  std::deque<std::string>& texts = answers().texts;
  return texts.emplace_back(std::move(text)).c_str();  // none moves when the next is added
}

diracstep_table keep(int columns, std::vector<std::string> cells) {
  Answers& kept = answers();
  kept.cells = std::move(cells);
  kept.cell_pointers.clear();
  for (const std::string& cell : kept.cells) kept.cell_pointers.push_back(cell.c_str());
  return {static_cast<int>(kept.cells.size()) / columns, columns, kept.cell_pointers.data()};
}

void keep(std::shared_ptr<const void> owner) { answers().others.push_back(std::move(owner)); }

const double* keep_numbers(std::vector<double> numbers) {
  if (numbers.empty()) return nullptr;
  const auto kept = std::make_shared<const std::vector<double>>(std::move(numbers));
  keep(kept);
  return kept->data();
}

bool stopped(const int* flag) {
  return flag != nullptr &&
         std::atomic_ref<int>(const_cast<int&>(*flag)).load(std::memory_order_relaxed) != 0;
}

}  // namespace diracstep::c_interface

const char* diracstep_message() { return c_interface::answers().message.c_str(); }

const char* diracstep_version() { return DIRACSTEP_VERSION; }
