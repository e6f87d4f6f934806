#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace tumbler {

/// The type of a field, by its number in descriptor.proto.
enum class ProtoKind : std::uint8_t {
  kDouble = 1,
  kFloat = 2,
  kInt64 = 3,
  kInt32 = 5,
  kFixed32 = 7,
  kBool = 8,
  kString = 9,
  kMessage = 11,
  kBytes = 12,
  kUint32 = 13,
  kEnum = 14,
};

/// A field of a message. Its number is its place among the fields, from 1 on.
struct ProtoField {
  std::string name;
  ProtoKind kind = ProtoKind::kDouble;
  std::string type{};  ///< Of messages and enumerations: the full name, e.g. `foxglove.Pose`.
  bool repeated = false;
  std::string comment{};
};

/// An enumeration within a message. Its values are numbered from 0 on.
struct ProtoEnum {
  std::string name;
  std::vector<std::string> values;
};

/// A type of messages in Protocol Buffers, version 3.
struct ProtoType {
  std::string name;  ///< Without its package.
  std::vector<ProtoField> fields;
  std::vector<ProtoEnum> enums{};
  std::string comment{};
};

/// A .proto file.
struct ProtoFile {
  std::string name;  ///< e.g. `tumbler.proto`
  std::string package;
  std::vector<std::string> imports;
  std::vector<ProtoType> types;
};

/// The files as a FileDescriptorSet, which tells readers what messages mean. Every file comes after
/// those that it imports.
[[nodiscard]] std::string EncodeDescriptors(const std::vector<ProtoFile>& files);

/// Appends the fields of one message. Zeros are written, too, so that the bytes of a message depend
/// on its values alone.
class ProtoWriter {
 public:
  /// @param out  has to outlive the writer.
  explicit ProtoWriter(std::string& out) : out_(out) {}

  void Double(int number, double value);
  void Float(int number, float value);
  /// Of any type of integers, and of enumerations and truth values.
  void Integer(int number, std::int64_t value);
  void Fixed32(int number, std::uint32_t value);
  /// Of strings, bytes and whole messages.
  void Bytes(int number, std::string_view value);
  /// Several integers in one field, as repeated fields are written.
  void Packed(int number, const std::vector<std::int32_t>& values);
  /// A message whose fields `fill` appends to the writer that it is given.
  template <typename Fill>
  void Message(int number, const Fill& fill) {
    std::string inner;
    ProtoWriter writer(inner);
    fill(writer);
    Bytes(number, inner);
  }

 private:
  void Varint(std::uint64_t value);
  void Tag(int number, unsigned wire_type);
  void LittleEndian(std::uint64_t value, int bytes);

  std::string& out_;
};

}  // namespace tumbler
