// Conversion between numbers and text, independent of the locale. A C interface for Fortran.
#include <algorithm>
#include <charconv>
#include <clocale>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>

namespace {

// The values are those of the Fortran module `text`.
enum form { fewest_digits, few_digits, significant, fixed_point };
enum outcome { ok, not_finite, malformed };
// Length of the longest text, that of a number with sixty decimals.
constexpr int longest = 400;

// Writes a finite number that is not negative; returns the end of the text.
char *write(double magnitude, int form, int n, char *out) {
  constexpr auto exponential = std::chars_format::scientific;
  constexpr int digits_for_people = 10, longest_of_python = 16;
  if (form == fixed_point)
    return std::to_chars(out, out + longest, magnitude, std::chars_format::fixed, std::min(n, 60))
        .ptr;
  char text[64] = {};
  const int most = form == significant ? n : digits_for_people,
            whole = form == significant ? n : longest_of_python;
  const auto done = form == fewest_digits
                        ? std::to_chars(text, text + 40, magnitude, exponential)
                        : std::to_chars(text, text + 40, magnitude, exponential, most - 1);
  char *last = std::find(text, done.ptr, 'e');
  const int exponent = std::atoi(last + 1);
  const bool is_long = exponent < -4 || exponent >= whole;
  if (is_long && form == significant)
    return std::copy(text, last, out) +
           std::sprintf(out + (last - text), n > 1 ? "E%+04d" : ".E%+04d", exponent);
  // The digits without their point and trailing zeros.
  if (last > text + 1)
    last = std::copy(text + 2, last, text + 1);
  while (last > text + 1 && last[-1] == '0')
    --last;
  const int count = static_cast<int>(last - text);
  if (exponent < 0 && !is_long)
    return std::copy(text, last, std::copy_n("0.000", 1 - exponent, out));
  const int before = is_long ? 1 : std::min(count, exponent + 1);
  out = std::copy_n(text, before, out);
  if (!is_long)
    out = std::fill_n(out, exponent + 1 - before, '0');
  if (count > before)
    *out++ = '.';
  out = std::copy(text + before, last, out);
  if (is_long)
    return out + std::sprintf(out, "e%+03d", exponent);
  // Fortran writes nothing after a point that follows the last digit.
  const char *const end = count > before || form == few_digits       ? ""
                          : form == significant && exponent == n - 1 ? "."
                                                                     : ".0";
  return std::copy_n(end, std::strlen(end), out);
}

} // namespace

extern "C" {

// Writes a number as text, filled up with blanks. Fewest digits: as many as determine the number,
// as Python writes them: 16.0, 1e-05. Few digits: ten at most, for people: 16; nothing for a number
// that is not finite. Significant: `n` digits without trailing zeros, as Fortran writes them: 16.0,
// 1.00000E-005. Fixed point: `n` decimals, and no point without them.
void bayesindent_write_real(double value, std::int32_t form, std::int32_t n, char *text,
                            std::int32_t length) {
  char written[longest + 8], *end = written;
  if (form == few_digits && std::abs(value) < std::numeric_limits<double>::min())
    *end++ = '0';
  else if (std::isfinite(value))
    end = write(std::abs(value), form, n, std::fill_n(written, std::signbit(value), '-'));
  else if (form != few_digits)
    end += std::sprintf(written, "%s",
                        std::isnan(value) ? "NaN"
                        : value > 0       ? "Infinity"
                                          : "-Infinity");
  end = std::min(end, written + length);
  std::fill(std::copy(written, end, text), text + length, ' ');
}

// Reads a real in the syntax of Fortran or C: 1, 1., .5, 1.0e-3, 1d0. It must fill the whole text;
// the value is 0 otherwise.
void bayesindent_read_real(const char *text, std::int32_t length, double *value,
                           std::int32_t *outcome) {
  *value = 0.0;
  *outcome = malformed;
  std::string digits(text + (length > 0 && (text[0] == '-' || text[0] == '+')), text + length);
  std::replace(digits.begin(), digits.end(), 'd', 'e');
  std::replace(digits.begin(), digits.end(), 'D', 'e');
  const char *const last = digits.data() + digits.size();
  static const locale_t neutral = newlocale(LC_ALL_MASK, "C", nullptr);
  double magnitude = 0.0;
  const auto done = std::from_chars(digits.data(), last, magnitude);
  // A second sign is not allowed.
  if (done.ec == std::errc::invalid_argument || done.ptr != last || digits[0] == '-')
    return;
  // Out of range are large numbers, which become infinite, and small ones, which become zero.
  if (done.ec != std::errc())
    magnitude = strtod_l(digits.c_str(), nullptr, neutral);
  *outcome = std::isfinite(magnitude) ? ok : not_finite;
  if (*outcome == ok)
    *value = text[0] == '-' ? -magnitude : magnitude;
}
}
