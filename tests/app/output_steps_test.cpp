#include "app/output_steps.h"

#include <gtest/gtest.h>

#include "core/error.h"

namespace parallax {
namespace {

TEST(OutputSteps, AllAreDoneAndTheFirstFailureIsThrownAtTheEnd) {
  OutputSteps step;
  int done = 0;
  EXPECT_NO_THROW(step.finish());
  step([&] { ++done; });
  EXPECT_FALSE(step.failed());
  step([&] { throw RunError("a.txt: cannot be written"); });
  EXPECT_TRUE(step.failed());
  step([&] { ++done; });
  step([&] { throw InputError("no truth"); });
  step([&] { ++done; });
  EXPECT_EQ(done, 3);
  ::testing::internal::CaptureStderr();
  try {
    step.finish();
    ADD_FAILURE() << "nothing was thrown";
  } catch (const RunError& e) {
    EXPECT_STREQ(e.what(), "a.txt: cannot be written");
  }
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "parallax: warning: no truth\n");
}

}  // namespace
}  // namespace parallax
