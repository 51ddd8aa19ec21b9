// The border: NumPy arrays and records in, views out; each is checked here and trusted behind.
//
//     Array<double, 2>                an ndarray of float64, 2 axes, C order; writable unless `const double`
//     Array<Body, 1>                  an ndarray of the dtype of Body, which this module made
//     a struct with GROUP_FIELDS      any object with attributes of these names, or a tuple of such objects
//
// A wrong kind, shape or order is a TypeError before anything has happened.
#pragma once

#include <nanobind/nanobind.h>

#define PY_ARRAY_UNIQUE_SYMBOL sonic_bullet_engine_numpy
#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#ifndef ENGINE_IMPORTS_NUMPY
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>

#include <algorithm>
#include <complex>
#include <string>
#include <type_traits>

#include "../array.hpp"
#include "../math/elementary.hpp"
#include "../row_fields.hpp"

namespace engine {

namespace nb = nanobind;
using namespace nb::literals;

template <class T, class = void>
struct IsRow : std::false_type {};
template <class T>
struct IsRow<T, std::void_t<decltype(RowFields<T>::all())>> : std::true_type {};

template <class T>
constexpr int typenum() {
    if constexpr (std::is_same_v<T, double>) return NPY_DOUBLE;
    if constexpr (std::is_same_v<T, float>) return NPY_FLOAT;
    if constexpr (std::is_same_v<T, bool>) return NPY_BOOL;
    if constexpr (std::is_same_v<T, int64_t>) return NPY_INT64;
    if constexpr (std::is_same_v<T, int32_t>) return NPY_INT32;
    if constexpr (std::is_same_v<T, std::int16_t>) return NPY_INT16;
    if constexpr (std::is_same_v<T, Complex>) return NPY_COMPLEX128;
    if constexpr (std::is_same_v<T, ComplexFloat>) return NPY_COMPLEX64;
    if constexpr (std::is_same_v<T, std::uint64_t>) return NPY_UINT64;
    if constexpr (std::is_same_v<T, std::complex<double>>) return NPY_CDOUBLE;
    return NPY_NOTYPE;
}

template <class Row>
PyArray_Descr*& dtype_slot() {
    static PyArray_Descr* dtype = nullptr;
    return dtype;
}

template <class T>
nb::object format_of() {  // of a scalar or a row, for numpy.dtype
    if constexpr (IsRow<T>::value) {
        return nb::borrow(reinterpret_cast<PyObject*>(dtype_slot<T>()));
    } else {
        return nb::steal(reinterpret_cast<PyObject*>(PyArray_DescrFromType(typenum<T>())));
    }
}

template <class Field>
nb::object shape_of() {
    nb::list shape;
    if constexpr (std::rank_v<Field> > 0) shape.append(std::extent_v<Field, 0>);
    if constexpr (std::rank_v<Field> > 1) shape.append(std::extent_v<Field, 1>);
    if constexpr (std::rank_v<Field> > 2) shape.append(std::extent_v<Field, 2>);
    static_assert(std::rank_v<Field> <= 3);
    return nb::tuple(shape);
}

// Make the dtype of a row and publish it under a name: once, when the module is imported; rows within rows first.
template <class Row>
void add_dtype(nb::module_& m, const char* name) {
    nb::list names, formats, offsets;
    std::apply(
        [&](auto... field) {
            (
                [&] {
                    using Field = typename decltype(field)::type;
                    names.append(field.name);
                    formats.append(nb::make_tuple(format_of<std::remove_all_extents_t<Field>>(), shape_of<Field>()));
                    offsets.append(field.offset);
                }(),
                ...);
        },
        RowFields<Row>::all());
    nb::dict layout;
    layout["names"] = names, layout["formats"] = formats, layout["offsets"] = offsets, layout["itemsize"] = sizeof(Row);
    nb::object dtype = nb::module_::import_("numpy").attr("dtype")(layout, "align"_a = true);
    dtype_slot<Row>() = reinterpret_cast<PyArray_Descr*>(dtype.inc_ref().ptr());
    m.attr(name) = dtype;
}

// Test whether each byte of an array of bool is 0 or 1: another, which a view of other bytes can have, is none.
inline bool are_truth_values(PyArrayObject* array) {
    const auto* bytes = static_cast<const unsigned char*>(PyArray_DATA(array));
    return std::all_of(bytes, bytes + PyArray_SIZE(array), [](unsigned char byte) { return byte <= 1; });
}

template <class T, int N>
bool view(nb::handle source, Array<T, N>& out) {
    using Plain = std::remove_const_t<T>;
    if (!PyArray_Check(source.ptr())) return false;
    auto* array = reinterpret_cast<PyArrayObject*>(source.ptr());
    if (PyArray_NDIM(array) != N) return false;
    if constexpr (IsRow<Plain>::value) {
        PyArray_Descr* dtype = PyArray_DESCR(array);
        if (dtype != dtype_slot<Plain>() && !PyArray_EquivTypes(dtype, dtype_slot<Plain>())) return false;
    } else {
        static_assert(typenum<Plain>() != NPY_NOTYPE);
        if (PyArray_TYPE(array) != typenum<Plain>() && !(std::is_same_v<Plain, int64_t> && PyArray_ISINTEGER(array) &&
                                                         PyArray_ISSIGNED(array) && PyArray_ITEMSIZE(array) == 8))
            return false;
    }
    int needed = NPY_ARRAY_C_CONTIGUOUS | NPY_ARRAY_ALIGNED;
    if (!std::is_const_v<T>) needed |= NPY_ARRAY_WRITEABLE;
    if (!PyArray_CHKFLAGS(array, needed) || !PyArray_ISNOTSWAPPED(array)) return false;
    out.data = static_cast<T*>(PyArray_DATA(array));
    for (int axis = 0; axis < N; ++axis) out.shape[axis] = PyArray_DIM(array, axis);
    if constexpr (std::is_same_v<T, const bool>) return are_truth_values(array);  // else it may be there to be filled
    return true;
}

// Make an array for Python, numbers not set, and its view.
template <class T, int N>
nb::object new_array(Array<T, N>& view, const int64_t (&shape)[N]) {
    npy_intp lengths[N];
    for (int axis = 0; axis < N; ++axis) lengths[axis] = shape[axis], view.shape[axis] = shape[axis];
    PyArray_Descr* dtype = nullptr;
    if constexpr (IsRow<T>::value) {
        dtype = dtype_slot<T>();
        Py_INCREF(reinterpret_cast<PyObject*>(dtype));
    } else {
        dtype = PyArray_DescrFromType(typenum<T>());
    }
    nb::object made = nb::steal(PyArray_Empty(N, lengths, dtype, 0));
    if (!made.is_valid()) nb::raise_python_error();
    view.data = static_cast<T*>(PyArray_DATA(reinterpret_cast<PyArrayObject*>(made.ptr())));
    return made;
}

[[noreturn]] inline void refuse(const char* name) {
    throw nb::type_error(
        (std::string(name) + ": not an array of the kind, shape and order that the engine takes").c_str());
}

// Check that an array has so many elements along each axis: a ValueError that names it.
template <class T, int N, class... Length>
void check_shape(const char* name, const Array<T, N>& array, Length... length) {
    static_assert(sizeof...(Length) == N);
    const int64_t wanted[N] = {static_cast<int64_t>(length)...};
    for (int axis = 0; axis < N; ++axis)
        if (array.shape[axis] != wanted[axis])
            throw nb::value_error((std::string(name) + ": " + std::to_string(array.shape[axis]) + " along axis " +
                                   std::to_string(axis) + ", not " + std::to_string(wanted[axis]))
                                      .c_str());
}

// Check an index that comes from a caller: a ValueError that names it.
inline void check_range(const char* name, int64_t index, int64_t low, int64_t stop) {
    if (index < low || index >= stop)
        throw nb::value_error((std::string(name) + ": " + std::to_string(index) + " is not in " + std::to_string(low) +
                               " … " + std::to_string(stop - 1))
                                  .c_str());
}

template <class Group, class = void>
struct IsGroup : std::false_type {};
template <class Group>
struct IsGroup<Group, std::void_t<decltype(sizeof(GroupFields<Group>))>> : std::true_type {};

template <class Value>
void read_value(const char* name, nb::handle source, Value& value) {
    value = nb::cast<Value>(source);
    (void)name;
}
template <class T, int N>
void read_value(const char* name, nb::handle source, Array<T, N>& value) {
    if (!view(source, value)) refuse(name);
}
template <class T, int N>
void read_value(const char* name, nb::handle source, T (&value)[N]) {
    int i = 0;
    for (nb::handle part : source) {
        if (i == N) refuse(name);
        read_value(name, part, value[i++]);
    }
    if (i != N) refuse(name);
}

// The attribute of an object; of a tuple of objects: of the first that has it.
inline nb::object attribute(nb::handle source, const char* name) {
    if (PyTuple_CheckExact(source.ptr())) {
        for (nb::handle holder : nb::borrow<nb::tuple>(source))
            if (PyObject_HasAttrString(holder.ptr(), name)) return holder.attr(name);
        throw nb::attribute_error(name);
    }
    return source.attr(name);
}

// Read a group from an object with its attributes, or from a tuple of such; `owner`, if given, keeps the arrays.
template <class Group>
void read_group(nb::handle source, Group& group, nb::list* owner = nullptr) {
    GroupFields<Group>::each(group, [&](const char* name, auto& value) {
        nb::object part = attribute(source, name);
        if (owner) owner->append(part);
        using Value = std::remove_reference_t<decltype(value)>;
        if constexpr (IsGroup<Value>::value) {
            read_group(part, value, owner);
        } else {
            read_value(name, part, value);
        }
    });
}

}  // namespace engine

namespace nanobind::detail {

template <class T, int N>
struct type_caster<engine::Array<T, N>> {
    using Value = engine::Array<T, N>;
    static constexpr auto Name = const_name("numpy.ndarray");
    template <class U>
    using Cast = Value;
    static constexpr bool IsClass = false;
    Value value;

    bool from_python(handle source, uint8_t, cleanup_list*) noexcept { return engine::view(source, value); }
    operator Value() { return value; }
    operator Value&() { return value; }
    template <class U>
    bool can_cast() const noexcept {
        return true;
    }
};

template <class Group>
    requires engine::IsGroup<Group>::value
struct type_caster<Group> {
    static constexpr auto Name = const_name("object");
    template <class U>
    using Cast = Group&;
    static constexpr bool IsClass = false;
    Group value;

    bool from_python(handle source, uint8_t, cleanup_list*) {
        engine::read_group(source, value);
        return true;
    }
    operator Group&() { return value; }
    template <class U>
    bool can_cast() const noexcept {
        return true;
    }
};

}  // namespace nanobind::detail
