#pragma once

#include <array>
#include <string>

namespace diracstep::bodies {

/// The text of a formula of a scene file, with the value it has for the parameters of the file; NaN where it
/// holds coordinates.  Sums and products leave out 0 and 1 and compute what is made of numbers alone.
class Formula {
 public:
  /// What a text is at its outermost: it stands in parentheses where another formula needs a tighter one.
  enum class Level { sum, product, power, atom };

  Formula(double number);
  Formula(std::string text, double value, Level level)
      : text_(std::move(text)), value_(value), level_(level) {}
  /// A coordinate, velocity or definition.
  static Formula name(std::string name, double value);
  static Formula name(std::string name);
  /// A function of one argument, "sin".
  static Formula call(const char* function, const Formula& argument, double value);

  const std::string& text() const { return text_; }
  double value() const { return value_; }
  bool is_number() const { return number_; }
  bool is(double number) const { return number_ && value_ == number; }
  /// In parentheses unless it is at least so tight.
  std::string within(Level level) const;

  friend Formula operator-(const Formula& a);
  friend Formula operator+(const Formula& a, const Formula& b);
  friend Formula operator-(const Formula& a, const Formula& b);
  friend Formula operator*(const Formula& a, const Formula& b);
  friend Formula operator/(const Formula& a, const Formula& b);

 private:
  bool negative() const { return text_.starts_with('-') && level_ == Level::product; }

  std::string text_;
  double value_;
  Level level_;
  bool number_ = false;
};

Formula square(const Formula& a);
Formula root(const Formula& a);
/// rate(a), the derivative by the time.
Formula rate_of(const Formula& a);

using Vec = std::array<Formula, 3>;
using Matrix = std::array<Vec, 3>;  ///< by rows

Vec operator+(const Vec& a, const Vec& b);
Vec operator-(const Vec& a, const Vec& b);
Vec operator*(const Formula& a, const Vec& b);
Vec operator*(const Matrix& a, const Vec& b);
Matrix operator*(const Matrix& a, const Matrix& b);
Matrix transposed(const Matrix& a);
Formula dot(const Vec& a, const Vec& b);
Vec cross(const Vec& a, const Vec& b);
Formula norm(const Vec& a);
/// a/|a|.
Vec unit(const Vec& a);
Vec rate_of(const Vec& a);
Vec zero_vector();
Matrix unit_matrix();

/// Two unit vectors e1, e2 with e1 × e2 = a, for a of length 1.
std::array<Vec, 2> across(const Vec& a);

}  // namespace diracstep::bodies
