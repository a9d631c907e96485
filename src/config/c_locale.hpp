/// The C locale for what the C library reads and writes.
#pragma once

#include <locale.h>  // of POSIX: newlocale

namespace frontier_surfels {

/// While one lives, printf, strtod and their like use the C locale in this thread, whatever locale the program has.
class CLocale {
 public:
  CLocale() : c_(newlocale(LC_ALL_MASK, "C", nullptr)), before_(uselocale(c_)) {}
  ~CLocale() {
    uselocale(before_);
    freelocale(c_);
  }
  CLocale(const CLocale&) = delete;
  CLocale& operator=(const CLocale&) = delete;

 private:
  locale_t c_, before_;
};

}  // namespace frontier_surfels
