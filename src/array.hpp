// Views of NumPy arrays: a pointer and a shape, C order, no ownership.
//
//     Array<double, 2> sound;  sound(b, n)  an element;  sound[b]  the row b, Array<double, 1>;  sound.shape[0]  its
//     length
//
// Elements are read in line wherever: the compiler's own measure leaves some calls in inner loops. Built with
// ENGINE_CHECKED, as the sanitizers' build is, every index is checked: a wrong one is told with its callers, and ends
// the process.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <type_traits>

#ifdef ENGINE_CHECKED
#include <sanitizer/common_interface_defs.h>

#include <cstdio>
#endif

namespace engine {

using std::int32_t;
using std::int64_t;

#ifdef ENGINE_CHECKED
[[noreturn, gnu::noinline]] inline void end_at_index(int64_t index, int64_t length) {
    std::fprintf(stderr, "index %lld of an array of %lld\n", static_cast<long long>(index),
                 static_cast<long long>(length));
    __sanitizer_print_stack_trace();
    std::abort();
}
#endif

// Check that an index is 0 … length - 1.
inline void check_index([[maybe_unused]] int64_t index, [[maybe_unused]] int64_t length) {
#ifdef ENGINE_CHECKED
    if (index < 0 || index >= length) end_at_index(index, length);
#endif
}

template <class T, int N>
struct Array {
    T* data = nullptr;
    int64_t shape[N] = {};

    int64_t size() const { return shape[0]; }

    operator Array<const T, N>() const
        requires(!std::is_const_v<T>)
    {
        Array<const T, N> same;
        same.data = data;
        for (int axis = 0; axis < N; ++axis) same.shape[axis] = shape[axis];
        return same;
    }

    [[gnu::always_inline]] int64_t stride() const {  // elements from one row to the next
        int64_t product = 1;
        for (int axis = 1; axis < N; ++axis) product *= shape[axis];
        return product;
    }

    [[gnu::always_inline]] Array<T, N - 1> operator[](int64_t i) const {
        check_index(i, shape[0]);
        Array<T, N - 1> row;
        for (int axis = 1; axis < N; ++axis) row.shape[axis - 1] = shape[axis];
        row.data = data + i * stride();
        return row;
    }

    template <class... Index>
    [[gnu::always_inline]] T& operator()(Index... index) const {
        static_assert(sizeof...(Index) == N);
        const int64_t at[N] = {static_cast<int64_t>(index)...};
        int64_t place = 0;
        for (int axis = 0; axis < N; ++axis) {
            check_index(at[axis], shape[axis]);
            place = place * shape[axis] + at[axis];
        }
        return data[place];
    }
};

template <class T>
struct Array<T, 1> {
    T* data = nullptr;
    int64_t shape[1] = {};

    int64_t size() const { return shape[0]; }

    operator Array<const T, 1>() const
        requires(!std::is_const_v<T>)
    {
        return {data, {shape[0]}};
    }

    [[gnu::always_inline]] T& operator[](int64_t i) const {
        check_index(i, shape[0]);
        return data[i];
    }
    [[gnu::always_inline]] T& operator()(int64_t i) const { return (*this)[i]; }

    T* from(int64_t first) const {  // what begins there: the end, where nothing does
        check_index(first, shape[0] + 1);
        return data + first;
    }

    Array part(int64_t first, int64_t stop) const {  // elements first … stop - 1
        check_index(stop, shape[0] + 1);
        check_index(first, stop + 1);
        return {data + first, {stop - first}};
    }
};

using Doubles = Array<double, 1>;
using Integers = Array<int64_t, 1>;

inline void set_zero(double* values, int64_t count) {  // by libc's widest stores, at any level of instructions
    if (count > 0) std::memset(values, 0, static_cast<size_t>(count) * sizeof(double));
}

}  // namespace engine
