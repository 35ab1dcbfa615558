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

/// Conversions between NumPy arrays and the library's. All require the GIL.
namespace locus_python {

namespace py = pybind11;

/// Any sequence of numbers; copied unless it is contiguous and of this type.
template <class Number> using Input = py::array_t<Number, py::array::c_style | py::array::forcecast>;

/// Returns a copy.
py::array_t<double> vector_of(std::span<const double> values);
/// Returns a copy of 36 numbers as six rows.
py::array_t<double> matrix_of(std::span<const double> values);

/// Returns rows x, y, z; (n, 3).
py::array_t<float> points_of(const std::vector<liblocus::Surface>& surfaces);
/// Returns rows x, y, z and the normal; (n, 6).
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

/// Contiguous bytes of a Python object, valid for the lifetime of this.
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
