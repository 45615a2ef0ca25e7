#pragma once

#include <gtest/gtest.h>

#include <diracstep/core/numerics/errors.hpp>
#include <initializer_list>
#include <string>

namespace diracstep::testing {

inline void expect_parts(const std::string& text, std::initializer_list<std::string> parts) {
  for (const std::string& part : parts)
    EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is missing in: " << text;
}

/// Fails unless `action` throws Misuse with a message that has all the parts.
template <class Action>
void expect_misuse(Action action, std::initializer_list<std::string> parts) {
  try {
    action();
    ADD_FAILURE() << "accepted; a Misuse was expected that says '" << *parts.begin() << "'";
  } catch (const Misuse& misuse) {
    expect_parts(misuse.what(), parts);
  }
}

}  // namespace diracstep::testing
