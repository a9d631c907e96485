/// Locales with a decimal comma, for tests that text is in the C locale all the same.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <clocale>
#include <cstdlib>
#include <filesystem>
#include <locale>
#include <sstream>
#include <string>

namespace frontier_surfels {

/// A test with a folder of its own, after which the C locale is in force again.
class LocaleTest : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override {
    std::locale::global(std::locale::classic());
    std::setlocale(LC_ALL, "C");
    unsetenv("LOCPATH");
    std::filesystem::remove_all(folder_);
  }

  /// Compares what `texts` returns in the C locale with what it returns when C++ streams write 1.234.567 for 1234567 and 0,5 for 0.5.
  template <typename Texts>
  void compare_with_streams(Texts texts) {
    struct Foreign : std::numpunct<char> {
      char do_decimal_point() const override { return ','; }
      char do_thousands_sep() const override { return '.'; }
      std::string do_grouping() const override { return "\3"; }
      std::string do_truename() const override { return "wahr"; }
      std::string do_falsename() const override { return "falsch"; }
    };
    const std::string in_c = texts();
    std::locale::global(std::locale(std::locale::classic(), new Foreign));
    std::ostringstream probe;
    probe << 1234567 << " " << 0.5;
    ASSERT_EQ(probe.str(), "1.234.567 0,5") << "the locale is not in force";
    EXPECT_EQ(texts(), in_c);
  }

  /// The same when functions of the C library write 0,5 for 0.5. Skips the test if there is no such locale.
  template <typename Texts>
  void compare_with_the_c_library(Texts texts) {
    const std::string in_c = texts();
    if (!set_c_locale()) GTEST_SKIP() << "There is no locale with a decimal comma: apt-get install locales";
    char probe[20];
    std::snprintf(probe, sizeof probe, "%.1f", 0.5);
    ASSERT_STREQ(probe, "0,5");
    EXPECT_EQ(texts(), in_c);
  }

  const std::filesystem::path folder_ = std::filesystem::temp_directory_path() / ("locale_" + std::to_string(getpid()));

 private:
  /// An installed locale, or one that is made from the definitions that the package `locales` has.
  bool set_c_locale() const {
    const char* const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "es_ES.UTF-8", "ru_RU.UTF-8"};
    for (const char* name : names)
      if (std::setlocale(LC_ALL, name) != nullptr) return true;
    const std::string made = (folder_ / "de_DE.UTF-8").string();
    if (std::system(("localedef --no-archive -i de_DE -f UTF-8 " + made + " > /dev/null 2>&1").c_str()) != 0) return false;
    setenv("LOCPATH", folder_.c_str(), 1);
    return std::setlocale(LC_ALL, names[0]) != nullptr;
  }
};

}  // namespace frontier_surfels
