// Runs something that must refuse its input, and says how it did.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "proto/json.hpp"

namespace combforce {

// The InputError thrown by `action`; a test failure, and an empty error, when there is none.
template <typename Action>
InputError refusal(Action action) {
  try {
    action();
  } catch (const InputError& error) {
    return error;
  }
  ADD_FAILURE() << "was not refused";
  return {"", "", ""};
}

}  // namespace combforce
