// All changes of a room in one program: CAIRN_CHANGE names the one that is made, and none is without it.
// schemata.py writes what uses this before the room's sources.
//
//   a < b        a < mutation::Less{1, 2} < b       binds as the operator does, whatever stands around it
//   a += b       a += mutation::Add{3} += b
//   ++a          mutation::Up{4}->*a
//
// CAIRN_REACHED names a file with a byte for each change, which is 1 where a run came by it.

#pragma once

#include <algorithm>
#include <cstdlib>
#include <initializer_list>
#include <type_traits>
#include <utility>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#define MUTATION_INLINE __attribute__((always_inline)) inline

namespace mutation {

// Of a change that cannot be compiled for the types that stand there.
inline constexpr int kNoSuchChange = 97;
// Where CAIRN_REACHED cannot be written.
inline constexpr int kNotRecorded = 98;

struct Choice {
  int change = std::getenv("CAIRN_CHANGE") ? std::atoi(std::getenv("CAIRN_CHANGE")) : 0;
  char* reached = Reached();

  // Shared with the file, so that it is there however the process ends.
  static char* Reached() {
    const char* name = std::getenv("CAIRN_REACHED");
    if (!name) return nullptr;
    const int file = open(name, O_RDWR | O_CLOEXEC);
    struct stat state;
    if (file < 0 || fstat(file, &state)) std::_Exit(kNotRecorded);
    void* bytes = mmap(nullptr, state.st_size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (bytes == MAP_FAILED) std::_Exit(kNotRecorded);
    close(file);
    return static_cast<char*>(bytes);
  }
};
inline const Choice kChoice;

// Changes are counted from 1; 0 is one that is not tried.
MUTATION_INLINE bool Is(int change) {
  if (kChoice.reached) [[unlikely]]
    kChoice.reached[change] = 1;
  return change && kChoice.change == change;
}

// What an expression computes is kept, not how: a sum of matrices that is returned may not refer to what is
// gone by then.
template <class T>
MUTATION_INLINE auto Value(T&& value) {
  if constexpr (requires { value.eval(); }) {
    return value.eval();
  } else {
    return std::decay_t<T>(std::forward<T>(value));
  }
}

// `first` for the change `first`, `second` for `second`.
#define MUTATION_OPERATOR(NAME, OP, FIRST, SECOND)                                                  \
  struct NAME {                                                                                     \
    int first, second = 0;                                                                          \
  };                                                                                                \
  template <class A>                                                                                \
  struct Left##NAME {                                                                               \
    A&& a;                                                                                          \
    NAME changes;                                                                                   \
  };                                                                                                \
  template <class A>                                                                                \
  MUTATION_INLINE Left##NAME<A> operator OP(A&& a, NAME changes) {                                  \
    return {std::forward<A>(a), changes};                                                           \
  }                                                                                                 \
  template <class A, class B>                                                                       \
  MUTATION_INLINE auto operator OP(Left##NAME<A> left, B&& b) {                                     \
    using Type = decltype(Value(std::forward<A>(left.a) OP std::forward<B>(b)));                    \
    if (Is(left.changes.first)) {                                                                   \
      if constexpr (requires { Type(Value(std::forward<A>(left.a) FIRST std::forward<B>(b))); }) {  \
        return Type(Value(std::forward<A>(left.a) FIRST std::forward<B>(b)));                       \
      } else {                                                                                      \
        std::_Exit(kNoSuchChange);                                                                  \
      }                                                                                             \
    }                                                                                               \
    if (Is(left.changes.second)) {                                                                  \
      if constexpr (requires { Type(Value(std::forward<A>(left.a) SECOND std::forward<B>(b))); }) { \
        return Type(Value(std::forward<A>(left.a) SECOND std::forward<B>(b)));                      \
      } else {                                                                                      \
        std::_Exit(kNoSuchChange);                                                                  \
      }                                                                                             \
    }                                                                                               \
    return Value(std::forward<A>(left.a) OP std::forward<B>(b));                                    \
  }
MUTATION_OPERATOR(Less, <, <=, >)
MUTATION_OPERATOR(LessEqual, <=, <, <)
MUTATION_OPERATOR(Greater, >, >=, <)
MUTATION_OPERATOR(GreaterEqual, >=, >, >)
MUTATION_OPERATOR(Equal, ==, !=, !=)
MUTATION_OPERATOR(NotEqual, !=, ==, ==)
MUTATION_OPERATOR(Plus, +, -, -)
MUTATION_OPERATOR(Minus, -, +, +)
MUTATION_OPERATOR(Times, *, /, /)
MUTATION_OPERATOR(Over, /, *, *)
#undef MUTATION_OPERATOR

#define MUTATION_ASSIGNMENT(NAME, OP, CHANGED)                              \
  template <class B>                                                        \
  struct Right##NAME {                                                      \
    B&& b;                                                                  \
    int change;                                                             \
  };                                                                        \
  struct NAME {                                                             \
    int change;                                                             \
    template <class B>                                                      \
    MUTATION_INLINE Right##NAME<B> operator OP(B&& b) const {               \
      return {std::forward<B>(b), change};                                  \
    }                                                                       \
  };                                                                        \
  template <class A, class B>                                               \
  MUTATION_INLINE decltype(auto) operator OP(A&& a, Right##NAME<B> right) { \
    if (Is(right.change)) {                                                 \
      if constexpr (requires { a CHANGED std::forward<B>(right.b); }) {     \
        a CHANGED std::forward<B>(right.b);                                 \
        return std::forward<A>(a);                                          \
      } else {                                                              \
        std::_Exit(kNoSuchChange);                                          \
      }                                                                     \
    }                                                                       \
    a OP std::forward<B>(right.b);                                          \
    return std::forward<A>(a);                                              \
  }
MUTATION_ASSIGNMENT(Add, +=, -=)
MUTATION_ASSIGNMENT(Subtract, -=, +=)
#undef MUTATION_ASSIGNMENT

// ++ and --.
struct Up {
  int change;
  template <class T>
  MUTATION_INLINE T& operator->*(T& value) const {
    if (Is(change)) {
      if constexpr (requires { --value; }) {
        --value;
        return value;
      } else {
        std::_Exit(kNoSuchChange);
      }
    }
    ++value;
    return value;
  }
};

// std::min and std::max.
struct Bound {
  bool is_least;
  template <class T>
  MUTATION_INLINE const T& operator()(const T& a, const T& b) const {
    return is_least ? std::min(a, b) : std::max(a, b);
  }
  template <class T, class Comparison>
  MUTATION_INLINE const T& operator()(const T& a, const T& b, Comparison comparison) const {
    return is_least ? std::min(a, b, comparison) : std::max(a, b, comparison);
  }
  template <class T>
  MUTATION_INLINE T operator()(std::initializer_list<T> values) const {
    return is_least ? std::min(values) : std::max(values);
  }
  template <class T>
  MUTATION_INLINE const T& Of(const T& a, const T& b) const {
    return (*this)(a, b);
  }
};
MUTATION_INLINE Bound Min(int change) { return {!Is(change)}; }
MUTATION_INLINE Bound Max(int change) { return {Is(change)}; }

}  // namespace mutation
