// A module whose constructor finds no memory, as those of a codec's libraries may.
#include <new>

namespace {

struct Throws {
  Throws() { throw std::bad_alloc(); }
};

const Throws throws;

}  // namespace
