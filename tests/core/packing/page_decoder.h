#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

// Reads range codes as schemas/FORMAT.md says it, written from that page alone: encoder and decoder share
// what chooses a bit's model, so that reading back what was written says nothing of it.
class PageDecoder {
 public:
  explicit PageDecoder(std::string_view bytes) { Start(bytes); }

  // Goes on with the next code, with what was learnt from those before.
  void Start(std::string_view bytes) {
    bytes_ = bytes;
    next_ = 0;
    range_ = 0xffffffff;
    code_ = 0;
    for (int i = 0; i < 4; ++i) code_ = code_ * 256 + NextByte();
  }

  // A bit of the model of that name for what is known of it.
  bool Bit(const std::string& name, const std::vector<int64_t>& known) {
    Model& model = models_[{name, known}];
    const uint64_t bound = (range_ / 32768) * static_cast<uint64_t>(model.p / 2);
    const bool bit = code_ >= bound;
    code_ -= bit ? bound : 0;
    range_ = bit ? range_ - bound : bound;
    Refill();
    model.num_bits = model.num_bits == 250 ? 250 : model.num_bits + 1;
    model.p += 2 * ((bit ? 0 : 65536) - model.p) / (2 * model.num_bits + 1);
    model.p = std::min(std::max(model.p, 64), 65536 - 64);
    return bit;
  }

  // Bits without a model.
  uint64_t Bits(int num_bits) {
    uint64_t value = 0;
    for (int i = 0; i < num_bits; ++i) {
      range_ /= 2;
      value *= 2;
      if (code_ >= range_) {
        code_ -= range_;
        ++value;
      }
      Refill();
    }
    return value;
  }

  int64_t Symbol(const std::string& name, int num_bits) {
    std::vector<int64_t> before;
    int64_t value = 0;
    for (int i = 0; i < num_bits; ++i) {
      before.push_back(Bit(name, before) ? 1 : 0);
      value = 2 * value + before.back();
    }
    return value;
  }

  int64_t Number(const std::string& name) {
    const int64_t length = Symbol(name, 6);
    if (length < 2) return length;
    const int64_t second = Bit(name + " second", {length}) ? 1 : 0;
    if (length == 2) return 2 + second;
    const int64_t third = Bit(name + " third", {length, second}) ? 1 : 0;
    return (4 + 2 * second + third) * (int64_t{1} << (length - 3)) +
           static_cast<int64_t>(Bits(static_cast<int>(length) - 3));
  }

  int64_t Signed(const std::string& name) {
    const int64_t size = Number(name);
    return size != 0 && Bit(name + " sign", {}) ? -size : size;
  }

  // Whether nothing is left, and nothing was read that there is not.
  bool IsAtEnd() const { return next_ == bytes_.size(); }

 private:
  struct Model {
    int p = 32768;
    int num_bits = 0;
  };

  void Refill() {
    for (; range_ < (1 << 24); range_ *= 256) code_ = code_ * 256 + NextByte();
  }

  uint64_t NextByte() { return next_ < bytes_.size() ? static_cast<uint8_t>(bytes_[next_++]) : (++next_, 0); }

  std::map<std::pair<std::string, std::vector<int64_t>>, Model> models_;
  std::string_view bytes_;
  size_t next_ = 0;
  uint64_t range_ = 0, code_ = 0;
};

}  // namespace cairn
