#include "runtime/record/proto_message.h"

#include <bit>

namespace tumbler {
namespace {

// The encoding of a field on the wire.
constexpr unsigned kWireVarint = 0;
constexpr unsigned kWire64 = 1;
constexpr unsigned kWireBytes = 2;
constexpr unsigned kWire32 = 5;

// The numbers of fields in descriptor.proto.
constexpr int kSetFile = 1;
constexpr int kFileName = 1, kFilePackage = 2, kFileDependency = 3, kFileMessageType = 4;
constexpr int kFileSourceCodeInfo = 9, kFileSyntax = 12;
constexpr int kTypeName = 1, kTypeField = 2, kTypeEnum = 4;
constexpr int kFieldName = 1, kFieldNumber = 3, kFieldLabel = 4, kFieldType = 5, kFieldTypeName = 6;
constexpr int kLabelOptional = 1, kLabelRepeated = 3;
constexpr int kEnumName = 1, kEnumValue = 2;
constexpr int kValueName = 1, kValueNumber = 2;
constexpr int kInfoLocation = 1;
constexpr int kLocationPath = 1, kLocationSpan = 2, kLocationComment = 3;

void EncodeType(const ProtoType& type, ProtoWriter& out) {
  out.Bytes(kTypeName, type.name);
  int number = 0;
  for (const ProtoField& field : type.fields) {
    ++number;
    out.Message(kTypeField, [&](ProtoWriter& w) {
      w.Bytes(kFieldName, field.name);
      w.Integer(kFieldNumber, number);
      w.Integer(kFieldLabel, field.repeated ? kLabelRepeated : kLabelOptional);
      w.Integer(kFieldType, static_cast<std::int64_t>(field.kind));
      if (!field.type.empty()) w.Bytes(kFieldTypeName, "." + field.type);
    });
  }
  for (const ProtoEnum& enumeration : type.enums) {
    out.Message(kTypeEnum, [&](ProtoWriter& w) {
      w.Bytes(kEnumName, enumeration.name);
      int value = 0;
      for (const std::string& name : enumeration.values) {
        w.Message(kEnumValue, [&](ProtoWriter& v) {
          v.Bytes(kValueName, name);
          v.Integer(kValueNumber, value);
        });
        ++value;
      }
    });
  }
}

/// Comments belong to places in the file: of type i, and of its field k.
void EncodeComments(const ProtoFile& file, ProtoWriter& out) {
  const auto comment = [&out](const std::vector<std::int32_t>& path, const std::string& text) {
    if (text.empty()) return;
    out.Message(kInfoLocation, [&](ProtoWriter& w) {
      w.Packed(kLocationPath, path);
      w.Packed(kLocationSpan, {0, 0, 0});
      w.Bytes(kLocationComment, " " + text + "\n");
    });
  };
  for (std::size_t i = 0; i < file.types.size(); ++i) {
    const auto type = static_cast<std::int32_t>(i);
    comment({kFileMessageType, type}, file.types[i].comment);
    for (std::size_t k = 0; k < file.types[i].fields.size(); ++k) {
      comment({kFileMessageType, type, kTypeField, static_cast<std::int32_t>(k)},
              file.types[i].fields[k].comment);
    }
  }
}

}  // namespace

std::string EncodeDescriptors(const std::vector<ProtoFile>& files) {
  std::string set;
  ProtoWriter out(set);
  for (const ProtoFile& file : files) {
    out.Message(kSetFile, [&file](ProtoWriter& w) {
      w.Bytes(kFileName, file.name);
      w.Bytes(kFilePackage, file.package);
      for (const std::string& import : file.imports) w.Bytes(kFileDependency, import);
      for (const ProtoType& type : file.types) {
        w.Message(kFileMessageType, [&type](ProtoWriter& t) { EncodeType(type, t); });
      }
      w.Message(kFileSourceCodeInfo, [&file](ProtoWriter& info) { EncodeComments(file, info); });
      w.Bytes(kFileSyntax, "proto3");
    });
  }
  return set;
}

void ProtoWriter::Varint(std::uint64_t value) {
  while (value >= 0x80U) {
    out_.push_back(static_cast<char>((value & 0x7fU) | 0x80U));
    value >>= 7U;
  }
  out_.push_back(static_cast<char>(value));
}

void ProtoWriter::Tag(int number, unsigned wire_type) {
  Varint((static_cast<std::uint64_t>(number) << 3U) | wire_type);
}

void ProtoWriter::LittleEndian(std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) {
    out_.push_back(static_cast<char>(value & 0xffU));
    value >>= 8U;
  }
}

void ProtoWriter::Double(int number, double value) {
  Tag(number, kWire64);
  LittleEndian(std::bit_cast<std::uint64_t>(value), 8);
}

void ProtoWriter::Float(int number, float value) {
  Tag(number, kWire32);
  LittleEndian(std::bit_cast<std::uint32_t>(value), 4);
}

void ProtoWriter::Integer(int number, std::int64_t value) {
  Tag(number, kWireVarint);
  Varint(static_cast<std::uint64_t>(value));
}

void ProtoWriter::Fixed32(int number, std::uint32_t value) {
  Tag(number, kWire32);
  LittleEndian(value, 4);
}

void ProtoWriter::Bytes(int number, std::string_view value) {
  Tag(number, kWireBytes);
  Varint(value.size());
  out_.append(value);
}

void ProtoWriter::Packed(int number, const std::vector<std::int32_t>& values) {
  std::string packed;
  ProtoWriter inner(packed);
  for (const std::int32_t value : values)
    inner.Varint(static_cast<std::uint64_t>(static_cast<std::int64_t>(value)));
  Bytes(number, packed);
}

}  // namespace tumbler
