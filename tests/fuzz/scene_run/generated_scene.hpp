#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace diracstep {

/// A scene file made from bytes: every byte is a choice in the grammar of scene files, so that most inputs
/// reach the integrator and small changes of an input make small changes of the scene.  Bytes that are
/// missing count as zero, which chooses what is simplest.
class GeneratedScene {
 public:
  GeneratedScene(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  std::string text() {
    coordinates_ = 1 + choose(3);
    repeated_ = choose(3) == 1;
    std::string scene = "name = \"g\"\n" + energies() + dissipation() + "[coordinates]\n";
    for (int i = 0; i < coordinates_; ++i) scene += name(i) + " = {}\n";
    if (repeated_)
      scene += "w = { for = \"i = 1..N\"" + std::string(choose(2) == 1 ? ", cyclic = true" : "") + " }\n";
    scene += "[sizes]\nN = " + std::to_string(1 + choose(4)) +
             "\n[parameters]\nk = 0.7\nm = 1.3\ntab = [0.5, -1.25, 2.0]\n";
    scene += "[definitions]\nd = \"" + formula(2) + "\"\n" + rows() + force() + start();
    return scene + "[span]\nend = 1\nstep = 0.01\n";
  }

 private:
  int choose(int count) { return at_ < size_ ? data_[at_++] % count : 0; }
  static std::string name(int i) { return std::string(1, "xyz"[i]); }
  std::string coordinate() { return name(choose(coordinates_)); }

  std::string energies() {
    std::string kinetic = "m*v_x^2/2";
    for (int i = 1; i < coordinates_; ++i)
      kinetic += choose(2) == 1 ? " + (1 + sin(x)^2)*v_" + name(i) + "^2/2" : " + v_" + name(i) + "^2/3";
    if (coordinates_ > 1 && choose(3) == 1) kinetic += " + cos(x)*v_x*v_y/7";
    if (repeated_) kinetic += " + sum(i = 1..N, v_w[i]^2/2)";
    std::string potential = formula(4);
    if (repeated_)
      potential +=
          choose(2) == 1 ? " + sum(i = 1..N, k*w[i]^2/2)" : " + sum(i = 1..N-1, (w[i+1] - w[i])^4/4)";
    return "lagrangian = \"" + kinetic + " - (" + potential + ")\"\n";
  }

  std::string dissipation() {
    return choose(3) == 1 ? "dissipation = \"(" + formula(1) + ")^2*v_" + coordinate() + "^2/2\"\n" : "";
  }

  std::string rows() {
    std::string text;
    if (coordinates_ > 1 && choose(3) == 1)
      text += "[[rows]]\nequation = \"v_y = (" + formula(2) + ")*v_x\"\n";
    if (coordinates_ > 2 && choose(3) == 1)
      text += "[[rows]]\nequation = \"z = " + formula(1) + " - (" + formula(1) + ")\"\n";
    return text;
  }

  std::string force() {
    return choose(2) == 1 ? "[force]\n" + coordinate() + " = \"" + formula(3) + " - k*v_x\"\n" : "";
  }

  std::string start() {
    std::string text = "[start]\nx = 0.3\n";
    if (choose(2) == 1) text += "v_x = 0.25\n";
    return choose(4) == 1 ? text + "project = true\n" : text;
  }

  std::string formula(int depth) {
    static const std::vector<std::string> functions{"sin",  "cos", "tanh", "atan", "asinh", "exp",
                                                    "sqrt", "log", "abs",  "tan",  "acos",  "sinh"};
    if (depth == 0 || --budget_ < 0) return leaf();
    switch (choose(12)) {
      case 0:
        return leaf();
      case 1:
        return formula(depth - 1) + " + " + formula(depth - 1);
      case 2:
        return formula(depth - 1) + " - (" + formula(depth - 1) + ")";
      case 3:
        return "(" + formula(depth - 1) + ")*(" + formula(depth - 1) + ")";
      case 4:
        return "(" + formula(depth - 1) + ")/(" + formula(depth - 1) + ")";
      case 5:
        return "(" + formula(depth - 1) + ")^" + std::to_string(choose(6));
      case 6:
        return functions[static_cast<std::size_t>(choose(static_cast<int>(functions.size())))] + "(" +
               formula(depth - 1) + ")";
      case 7:
        return std::string(choose(2) == 1 ? "min(" : "max(") + formula(depth - 1) + ", " +
               formula(depth - 1) + ")";
      case 8:
        return "sqrt(1 + (" + formula(depth - 1) + ")^2)";
      case 9:
        return "exp(-(" + formula(depth - 1) + ")^2)";
      case 10:
        return "pow(1 + (" + formula(depth - 1) + ")^2, " + formula(depth - 1) + ")";
      default:
        return "diff(" + formula(depth - 1) + ", " + coordinate() + ")";
    }
  }

  std::string leaf() {
    switch (choose(8)) {
      case 1:
        return "k";
      case 2:
        return "t";
      case 3:
        return "tab[" + std::to_string(1 + choose(3)) + "]";
      case 4:
        return std::to_string(choose(256)) + "e-" + std::to_string(choose(4));
      case 5:
        return "pi";
      case 6:
        return "1";
      default:
        return coordinate();
    }
  }

  const std::uint8_t* data_;
  std::size_t size_, at_ = 0;
  int coordinates_ = 1;
  int budget_ = 60;  ///< operations, so that an input cannot grow without bound
  bool repeated_ = false;
};

}  // namespace diracstep
