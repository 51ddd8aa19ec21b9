// Rows of the engine's tables: a plain struct, and the list of its fields, from which NumPy's dtype is made.
//
//     struct Turn { int64_t mode; double by[2][2]; };
//     ROW_FIELDS(Turn, mode, by)          the dtype of the same names, places and size: python/arrays.hpp
//
// That no field is forgotten is checked when it is compiled: the sizes of all that are named add up to the struct's.
#pragma once

#include <cstddef>
#include <tuple>

namespace engine {

template <class Field>
struct FieldOf {
    using type = Field;
    const char* name;
    std::size_t offset;
};

template <class Row>
struct RowFields;  // one for each row: `names`, `all()`

}  // namespace engine

#define ENGINE_EXPAND(...) ENGINE_EXPAND3(ENGINE_EXPAND3(ENGINE_EXPAND3(__VA_ARGS__)))
#define ENGINE_EXPAND3(...) ENGINE_EXPAND2(ENGINE_EXPAND2(ENGINE_EXPAND2(__VA_ARGS__)))
#define ENGINE_EXPAND2(...) ENGINE_EXPAND1(ENGINE_EXPAND1(ENGINE_EXPAND1(__VA_ARGS__)))
#define ENGINE_EXPAND1(...) ENGINE_EXPAND0(ENGINE_EXPAND0(ENGINE_EXPAND0(__VA_ARGS__)))
#define ENGINE_EXPAND0(...) __VA_ARGS__
#define ENGINE_AGAIN ()
// apply(x, first), apply(x, second), …
#define ENGINE_EACH(apply, x, ...) __VA_OPT__(ENGINE_EXPAND(ENGINE_EACH_STEP(apply, x, __VA_ARGS__)))
#define ENGINE_EACH_STEP(apply, x, first, ...) \
    apply(x, first) __VA_OPT__(, ENGINE_EACH_NEXT ENGINE_AGAIN(apply, x, __VA_ARGS__))
#define ENGINE_EACH_NEXT() ENGINE_EACH_STEP

#define ENGINE_FIELD(Row, field)              \
    ::engine::FieldOf<decltype(Row::field)> { \
        #field, offsetof(Row, field)          \
    }
#define ENGINE_SIZE(Row, field) sizeof(Row::field)
#define ENGINE_ADD(...) ::engine::sum_of(__VA_ARGS__)

namespace engine {
template <class... Size>
constexpr std::size_t sum_of(Size... size) {
    return (std::size_t{0} + ... + size);
}
}  // namespace engine

#define ROW_FIELDS(Row, ...)                                                                       \
    template <>                                                                                    \
    struct RowFields<Row> {                                                                        \
        static_assert(sum_of(ENGINE_EACH(ENGINE_SIZE, Row, __VA_ARGS__)) == sizeof(Row),           \
                      "a field of " #Row " is missing in its list, or it has padding");            \
        static auto all() { return std::make_tuple(ENGINE_EACH(ENGINE_FIELD, Row, __VA_ARGS__)); } \
    };

// Tables that travel together: a struct of arrays and numbers, each named as the attribute it is read from in Python.
namespace engine {
template <class Group>
struct GroupFields;  // one for each group: `each(group, visit)`
}

#define ENGINE_VISIT(visit, field) (visit(#field, group.field), 0)
#define GROUP_FIELDS(Group, ...)                                                  \
    template <>                                                                   \
    struct GroupFields<Group> {                                                   \
        template <class Visit>                                                    \
        static void each(Group& group, Visit&& visit) {                           \
            (void)std::make_tuple(ENGINE_EACH(ENGINE_VISIT, visit, __VA_ARGS__)); \
        }                                                                         \
    };
