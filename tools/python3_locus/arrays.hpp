// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "liblocus.hpp"

/// Between arrays of NumPy and those of the library. All of it needs the interpreter's lock.
namespace locus_python {

namespace py = pybind11;

/// What comes in: any sequence of numbers, copied where it lies otherwise.
template <class Number> using Input = py::array_t<Number, py::array::c_style | py::array::forcecast>;

/// A copy of its own.
py::array_t<double> vector_of(std::span<const double> values);
/// The same of 36 numbers as six rows.
py::array_t<double> matrix_of(std::span<const double> values);

/// Rows x, y, z; (n, 3).
py::array_t<float> points_of(const std::vector<liblocus::Surface>& surfaces);
/// Rows x, y, z and the normal; (n, 6).
py::array_t<float> surfaces_of(const std::vector<liblocus::Surface>& surfaces);

/// Throws liblocus::Error for another shape.
template <std::size_t Size> std::array<double, Size> numbers_of(const char* name, const Input<double>& input) {
  if (input.ndim() != 1 || input.size() != Size)
    throw liblocus::Error(std::string{name} + ": give " + std::to_string(Size) + " numbers");
  std::array<double, Size> numbers{};
  for (std::size_t i = 0; i < Size; ++i)
    numbers[i] = input.data()[i];
  return numbers;
}

template <class Number> std::span<const Number> span_of(const Input<Number>& input) {
  return {input.data(), static_cast<std::size_t>(input.size())};
}

/// The bytes of an object that has some in a row. They stay until this is gone.
class Bytes {
 public:
  explicit Bytes(const py::buffer& object);
  ~Bytes() { PyBuffer_Release(&view_); }
  Bytes(const Bytes&) = delete;
  Bytes& operator=(const Bytes&) = delete;

  [[nodiscard]] std::span<const std::byte> span() const {
    return {static_cast<const std::byte*>(view_.buf), static_cast<std::size_t>(view_.len)};
  }

 private:
  Py_buffer view_{};
};

} // namespace locus_python
