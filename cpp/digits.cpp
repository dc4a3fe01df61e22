// Numbers to text and back, whatever the country that is set. A C interface, for Fortran.
#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>

namespace {

// As the Fortran side has them.
enum form { fewest_digits, few_digits, significant, fixed_point };
enum outcome { ok, not_finite, malformed };

// A finite number that is not negative.
std::string written(double size, int form, int n) {
  constexpr auto exponential = std::chars_format::scientific;
  constexpr int digits_for_people = 10, longest_of_python = 16;
  char text[400];
  char *const last = text + sizeof text;
  if (form == fixed_point)
    return {text, std::to_chars(text, last, size, std::chars_format::fixed, std::min(n, 60)).ptr};
  const int most = form == significant ? n : digits_for_people, longest = form == significant ? n : longest_of_python;
  const auto done =
      form == fewest_digits ? std::to_chars(text, last, size, exponential) : std::to_chars(text, last, size, exponential, most - 1);
  const std::string whole(text, done.ptr), mantissa = whole.substr(0, whole.find('e'));
  const int exponent = std::atoi(whole.c_str() + mantissa.size() + 1);
  std::string digits = mantissa.substr(0, 1) + (mantissa.size() > 1 ? mantissa.substr(2) : "");
  digits.resize(std::max<std::size_t>(1, digits.find_last_not_of('0') + 1));
  const int count = static_cast<int>(digits.size());
  if (exponent < -4 || exponent >= longest) {
    std::snprintf(text, sizeof text, form == significant ? "E%+04d" : "e%+03d", exponent);
    if (form == significant)
      return mantissa + (n > 1 ? "" : ".") + text;
    return digits.substr(0, 1) + (count > 1 ? "." : "") + digits.substr(1) + text;
  }
  if (exponent < 0)
    return "0." + std::string(-exponent - 1, '0') + digits;
  if (count > exponent + 1)
    return digits.substr(0, exponent + 1) + "." + digits.substr(exponent + 1);
  digits += std::string(exponent + 1 - count, '0');
  // Fortran has nothing after a point that follows the last of its digits.
  return digits + (form == few_digits ? "" : form == significant && exponent == n - 1 ? "." : ".0");
}

// Whether these digits, with their exponent, are a number of 1 or more.
bool is_large(const std::string &digits) {
  const std::size_t mark = std::min(digits.find('e'), digits.size()), point = std::min(digits.find('.'), mark);
  const double exponent = mark < digits.size() ? static_cast<double>(std::strtol(digits.c_str() + mark + 1, nullptr, 10)) : 0.0;
  return static_cast<double>(point) - static_cast<double>(digits.find_first_of("123456789")) + exponent > 0.0;
}

} // namespace

extern "C" {

// A number as text, with blanks after it. Fewest digits: those that bring the number back, as Python writes them: 16.0, 1e-05. Few
// digits: ten at most, for people: 16; nothing where it is not finite. Significant: `n` digits, without zeros at their end, as
// Fortran writes them: 16.0, 1.00000E-005. Fixed point: `n` decimals, and no point without them.
void bayesindent_write_real(double value, std::int32_t form, std::int32_t n, char *text, std::int32_t length) {
  std::string string;
  if (form == few_digits && std::abs(value) < std::numeric_limits<double>::min())
    string = "0";
  else if (std::isfinite(value))
    string = (std::signbit(value) ? "-" : "") + written(std::abs(value), form, n);
  else if (form != few_digits)
    string = std::isnan(value) ? "NaN" : value > 0 ? "Infinity" : "-Infinity";
  string.resize(length, ' ');
  string.copy(text, length);
}

// A real in the syntax of Fortran or C, the whole text: 1, 1., .5, 1.0e-3, 1d0. Where it is none, the value is 0.
void bayesindent_read_real(const char *text, std::int32_t length, double *value, std::int32_t *outcome) {
  *value = 0.0;
  std::string digits(text, length);
  std::transform(digits.begin(), digits.end(), digits.begin(), [](unsigned char c) { return std::tolower(c); });
  if (digits[0] == '-' || digits[0] == '+')
    digits.erase(0, 1);
  *outcome = not_finite;
  if (digits == "nan" || digits == "inf" || digits == "infinity" || digits.compare(0, 4, "nan(") == 0)
    return;
  *outcome = malformed;
  std::replace(digits.begin(), digits.end(), 'd', 'e');
  if (digits.find_first_not_of(".0123456789e+-") < digits.size() || digits[0] == '-')
    return;
  double size = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), size);
  if (error == std::errc::invalid_argument || end != digits.data() + digits.size())
    return;
  // Out of range is what is too small, too.
  *outcome = std::isfinite(size) && (error == std::errc() || !is_large(digits)) ? ok : not_finite;
  if (*outcome == ok)
    *value = text[0] == '-' ? -size : size;
}

// A decimal integer with an optional sign, the whole text. Where it is none, the value is 0.
void bayesindent_read_integer(const char *text, std::int32_t length, std::int32_t *value, std::int32_t *outcome) {
  *value = 0;
  *outcome = malformed;
  const bool has_sign = length > 0 && (text[0] == '-' || text[0] == '+');
  std::uint32_t size = 0;
  const auto [end, error] = std::from_chars(text + has_sign, text + length, size);
  if (error == std::errc::invalid_argument || end != text + length)
    return;
  *outcome = error == std::errc() && size <= INT32_MAX ? ok : not_finite;
  if (*outcome == ok)
    *value = static_cast<std::int32_t>(text[0] == '-' ? -size : size);
}
}
