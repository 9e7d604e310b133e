#include "app/progress_bar.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <string>

namespace parallax {
namespace {

std::string read_what_is_there(int fd) {
  fcntl(fd, F_SETFL, O_NONBLOCK);
  std::string text(65536, '\0');
  const ssize_t n = read(fd, text.data(), text.size());
  text.resize(n > 0 ? static_cast<size_t>(n) : 0);
  return text;
}

TEST(ProgressText, ShowsShareAndCount) {
  const std::string text = progress_text("tracking", 200, 400, "good", 200);
  EXPECT_EQ(text, "tracking [" + std::string(15, '#') + std::string(15, ' ') + "]  50 %  200/400  good");
  EXPECT_EQ(progress_text("tracking", 900, 400, "", 200).find(" 400/400") == std::string::npos, false);
  EXPECT_EQ(progress_text("tracking", 17, -1, "", 200), "tracking 17");
}

TEST(ProgressText, FitsTheTerminal) {
  EXPECT_EQ(progress_text("tracking", 200, 400, "good", 20).size(), 20u);
  EXPECT_EQ(progress_text("tracking", 1'900'000'000, 2'000'000'000, "", 200).find("] 95 %") == std::string::npos, true);
  EXPECT_NE(progress_text("tracking", 1'900'000'000, 2'000'000'000, "", 200).find(" 95 %"), std::string::npos);
}

TEST(ProgressBar, WritesNothingIntoAPipe) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  {
    ProgressBar bar("tracking", 10, ends[1]);
    for (int i = 0; i <= 10; ++i) bar.update(i);
  }
  close(ends[1]);
  EXPECT_EQ(read_what_is_there(ends[0]), "");
  close(ends[0]);
}

TEST(ProgressBar, DrawsSeldomAndErasesItself) {
  int controller = -1, terminal = -1;
  ASSERT_EQ(openpty(&controller, &terminal, nullptr, nullptr, nullptr), 0);
  {
    ProgressBar bar("tracking", 1'000'000, terminal);
    for (int i = 0; i < 1000; ++i) bar.update(i);
  }
  const std::string text = read_what_is_there(controller);
  const std::string erase = "\r\033[K";
  ASSERT_GE(text.size(), erase.size());
  EXPECT_NE(text.find("tracking ["), std::string::npos);
  EXPECT_EQ(text.substr(text.size() - erase.size()), erase);
  // A thousand updates in a row are far fewer than a thousand drawings.
  size_t drawings = 0;
  for (size_t at = text.find("tracking ["); at != std::string::npos; at = text.find("tracking [", at + 1)) ++drawings;
  EXPECT_LT(drawings, 100u);
  close(terminal);
  close(controller);
}

}  // namespace
}  // namespace parallax
