#include "firmware_interface/devices/eds.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/files/toml_reader.h"
#include "firmware_interface/devices/drives_toml.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;

/// A variable of a data sheet.
std::string Variable(const std::string& section, int type, const std::string& access,
                     const std::string& more = "") {
  return fmt::format(
      "[{}]\nParameterName=some object\nObjectType=0x7\nDataType=0x{:04X}\nAccessType={}\n{}\n",
      section, type, access, more);
}

constexpr int kU8 = 5, kU16 = 6, kU32 = 7, kI8 = 2, kI16 = 3, kI32 = 4;

/// The data sheet of a drive that has everything that the set-up writes.
std::string WholeSheet() {
  std::string sheet = "; a drive\n[FileInfo]\nFileName=drive.eds\n\n";
  sheet += Variable("1006", kU32, "rw");
  sheet += "[1016]\nObjectType=0x8\nSubNumber=2\n\n" + Variable("1016sub0", kU8, "ro") +
           Variable("1016sub1", kU32, "rw");
  sheet += Variable("1017", kU16, "rw", "LowLimit=0\nHighLimit=0x2710\nDefaultValue=0");
  for (const char* pdo : {"1400", "1401", "1800", "1801"}) {
    sheet += fmt::format("[{}]\nObjectType=0x9\n\n", pdo);
    sheet += Variable(fmt::format("{}sub0", pdo), kU8, "ro");
    sheet += Variable(fmt::format("{}sub1", pdo), kU32, "rw", "DefaultValue=$NODEID+0x200");
    sheet += Variable(fmt::format("{}sub2", pdo), kU8, "rw");
  }
  // Arrays whose parts have no sections of their own.
  for (const char* mapping : {"1600", "1601", "1A00", "1A01"}) {
    sheet += fmt::format(
        "[{}]\nObjectType=0x9\nDataType=0x0007\nAccessType=rw\nCompactSubObj=8\n\n", mapping);
  }
  sheet += Variable("6007", kI16, "rw");
  sheet += Variable("6040", kU16, "rww", "PDOMapping=1");
  sheet += Variable("6041", kU16, "ro", "PDOMapping=1");
  sheet += Variable("605A", kI16, "rw", "LowLimit=-128\nHighLimit=127");
  sheet += Variable("6060", kI8, "rww", "PDOMapping=1");
  sheet += Variable("6061", kI8, "ro", "PDOMapping=1");
  sheet += Variable("6064", kI32, "ro", "PDOMapping=1");
  sheet += Variable("6065", kU32, "rw");
  sheet += Variable("606C", kI32, "ro", "PDOMapping=1");
  sheet += Variable("6077", kI16, "ro", "PDOMapping=1");
  sheet += Variable("607A", kI32, "rww", "PDOMapping=1");
  sheet += Variable("60B1", kI32, "rww", "PDOMapping=1");
  sheet += Variable("60B2", kI16, "rww", "PDOMapping=1");
  sheet += Variable("60C2sub1", kU8, "rw") + Variable("60C2sub2", kI8, "rw");
  return sheet;
}

std::string WithoutSection(const std::string& sheet, const std::string& name) {
  const std::size_t begin = sheet.find("[" + name + "]");
  EXPECT_NE(begin, std::string::npos) << name;
  const std::size_t next = sheet.find("\n[", begin);
  return sheet.substr(0, begin) + (next == std::string::npos ? "" : sheet.substr(next + 1));
}

std::string With(const std::string& text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.substr(0, at) + to + text.substr(at + from.size());
}

/// The shipped CiA 402 drives, the first of which has this data sheet.
DrivesConfig DrivesWith(const std::string& sheet, const std::string& more = "",
                        std::vector<std::string>* asked = nullptr) {
  const std::string shipped =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives_cia402.toml"));
  const std::string text = With(shipped, "protocol = \"canopen-csp\"",
                                "protocol = \"canopen-csp\"\neds = \"a.eds\"\n" + more);
  return ParseDrives(text, "folder/d.toml", DrivesUse::kRun, [&](const std::string& path) {
    if (asked != nullptr) asked->push_back(path);
    return sheet;
  });
}

std::string RefusalOf(const std::string& sheet, const std::string& more = "") {
  try {
    static_cast<void>(DrivesWith(sheet, more));
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

std::uint8_t MayLackOf(const DrivesConfig& drives) {
  return std::get<Cia402Config>(drives.drives[0].config).may_lack;
}

TEST(Eds, ADriveThatHasEverythingIsTakenAndLacksNothing) {
  std::vector<std::string> asked;
  const DrivesConfig drives = DrivesWith(WholeSheet(), "", &asked);
  EXPECT_EQ(MayLackOf(drives), 0);
  EXPECT_THAT(asked, ::testing::ElementsAre("folder/a.eds"));
}

TEST(Eds, WhatADriveMayLackAndLacksNeedNotBeSaidInTheDrivesFile) {
  std::string sheet = WithoutSection(WithoutSection(WholeSheet(), "1006"), "60C2sub2");
  EXPECT_EQ(MayLackOf(DrivesWith(sheet)), 0b00011);
  EXPECT_EQ(MayLackOf(DrivesWith(WithoutSection(sheet, "605A"), "may_lack = [\"6065h\"]")),
            0b01111);
}

TEST(Eds, WhatADriveMustHaveIsRefusedByItsName) {
  for (const auto& [section, name] :
       std::vector<std::pair<std::string, std::string>>{{"1017", "1017h:00"},
                                                        {"1016sub1", "1016h:01"},
                                                        {"1401sub2", "1401h:02"},
                                                        {"1A01", "1A01h:00"},
                                                        {"607A", "607Ah:00"},
                                                        {"6061", "6061h:00"}}) {
    const std::string refusal = RefusalOf(WithoutSection(WholeSheet(), section));
    EXPECT_THAT(refusal, ::testing::MatchesRegex("folder/d\\.toml:[0-9]+: drive\\[0\\]\\.eds: .+"));
    EXPECT_THAT(refusal, HasSubstr("object " + name + " is not in folder/a.eds"));
  }
  EXPECT_THAT(
      RefusalOf(WithoutSection(WholeSheet(), "6007")),
      HasSubstr("object 6007h:00 is not in folder/a.eds, so the drive does not react to the "
                "host's silence: say watchdog_s = 0"));
}

TEST(Eds, OtherTypesAccessLimitsAndMappingsAreRefusedWithTheLineOfTheObject) {
  const std::string whole = WholeSheet();
  const auto changed = [&](const std::string& section, const std::string& from,
                           const std::string& to) {
    const std::size_t at = whole.find("[" + section + "]");
    return whole.substr(0, at) + With(whole.substr(at), from, to);
  };
  EXPECT_THAT(RefusalOf(changed("1017", "0x0006", "0x0007")),
              HasSubstr("object 1017h:00 has DataType 0x0007 of 32 bits, and 16 bits are written "
                        "(folder/a.eds:"));
  EXPECT_THAT(RefusalOf(changed("6064", "0x0004", "0x0008")),
              HasSubstr("object 6064h:00 has DataType 0x0008, and 32 bits are expected"));
  EXPECT_THAT(RefusalOf(changed("605A", "AccessType=rw", "AccessType=const")),
              HasSubstr("object 605Ah:00 has AccessType const, and it is written"));
  EXPECT_THAT(RefusalOf(changed("6061", "AccessType=ro", "AccessType=wo")),
              HasSubstr("object 6061h:00 has AccessType wo, and it is read"));
  EXPECT_THAT(RefusalOf(changed("60B2", "PDOMapping=1", "PDOMapping=0")),
              HasSubstr("object 60B2h:00 has PDOMapping=0, and it is in a PDO"));
  EXPECT_THAT(RefusalOf(changed("1017", "HighLimit=0x2710", "HighLimit=99")),
              HasSubstr("object 1017h:00 is to be 100, and its limits are 0 ... 99"));
}

TEST(Eds, OfADcfTheNodeHasToBeTheFiles) {
  const std::string commissioned = WholeSheet() + "[DeviceComissioning]\nNodeID=";
  EXPECT_EQ(MayLackOf(DrivesWith(commissioned + "1\n")), 0);
  EXPECT_THAT(RefusalOf(commissioned + "5\n"),
              HasSubstr("folder/a.eds is of node 5, and node_id is 1"));
}

/// The object 1017h of a text, with node 0x21.
EdsObject ObjectOf(const std::string& text) {
  return ElectronicDataSheet::Parse(text, "t.eds", 0x21).Find(0x1017, 0).value();
}

TEST(Eds, NumbersAreDecimalHexadecimalOctalOrSumsWithTheNode) {
  for (const auto& [text, value] :
       std::vector<std::pair<std::string, std::int64_t>>{{"10", 10},
                                                         {"0x10", 16},
                                                         {"0X1f", 31},
                                                         {"010", 8},
                                                         {"0", 0},
                                                         {"-5", -5},
                                                         {"-0x10", -16},
                                                         {"$NODEID", 0x21},
                                                         {"$NODEID+0x180", 0x1a1},
                                                         {"0x180 + $nodeid", 0x1a1},
                                                         {"1+$NODEID+1", 0x23},
                                                         {"0xffffffff", 0xffffffff}}) {
    EXPECT_EQ(ObjectOf(Variable("1017", kU32, "rw", "LowLimit=" + text)).low, value) << text;
  }
  for (const std::string text : {"x", "0x", "08", "1e3", "$NODE", "$NODEID+", "+", "--1",
                                 "0xfffffffffffffffff", "1 2", "0b1"}) {
    try {
      static_cast<void>(ObjectOf(Variable("1017", kU32, "rw", "LowLimit=" + text)));
      ADD_FAILURE() << text << " was accepted";
    } catch (const FileError& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr("t.eds:6: LowLimit: is '" + text + "'; allowed: a number"));
    }
  }
}

TEST(Eds, ASumThatNoIntegerHoldsIsNoNumber) {
  // Sixteen times 2^60 - 1 are -16 where integers wrap around.
  const std::string most = "0xfffffffffffffff";
  std::string sum = most;
  for (int i = 1; i < 16; ++i) sum.append("+").append(most);
  const std::string negative =
      std::string("-").append(most).append("+-").append(sum).append("+-").append(sum);
  for (const std::string& text : {sum, "$NODEID+" + sum, negative}) {
    EXPECT_THROW(static_cast<void>(ObjectOf(Variable("1017", kU32, "rw", "LowLimit=" + text))),
                 FileError)
        << text;
  }
}

TEST(Eds, AnArrayWithoutSectionsForItsPartsHasSoManyAndNoMore) {
  const auto sheet = ElectronicDataSheet::Parse(
      "[1600]\nObjectType=0x9\nDataType=7\nAccessType=rw\nCompactSubObj=3\n", "t.eds", 1);
  EXPECT_EQ(sheet.Find(0x1600, 0).value().bits, 8) << "how many there are";
  for (std::uint8_t sub = 1; sub <= 3; ++sub) EXPECT_EQ(sheet.Find(0x1600, sub).value().bits, 32);
  EXPECT_FALSE(sheet.Find(0x1600, 4).has_value());
  EXPECT_FALSE(sheet.Find(0x1600, 255).has_value());
}

TEST(Eds, CaseBlanksLineEndsCommentsAndAByteOrderMarkDoNotMatter) {
  std::string text = "\xef\xbb\xbf; comment\n\n" + Variable("1017", kU16, "RW", "  lowlimit =  3 ");
  text = With(text, "AccessType", "accessTYPE");
  std::string carriage;
  for (const char c : text) carriage += c == '\n' ? std::string("\r\n") : std::string(1, c);
  for (const std::string& each : {text, carriage}) {
    const EdsObject object = ObjectOf(each);
    EXPECT_EQ(object.bits, 16);
    EXPECT_EQ(object.access, "rw");
    EXPECT_EQ(object.low, 3);
    EXPECT_EQ(object.high, std::nullopt) << "an empty value is none";
    EXPECT_EQ(object.line, 3U);
  }
}

TEST(Eds, HostileFilesAreRefusedWithFileLineAndKey) {
  const std::string good = Variable("1017", kU16, "rw");
  struct Case {
    std::string text;
    std::string fragment;
  };
  const std::vector<Case> cases = {
      {"", "t.eds:1: "},
      {"[FileInfo]\nFileName=x\n", "holds no object"},
      {std::string("[1017]\nData") + '\0' + "Type=6\n", "t.eds:2: holds a byte of zero"},
      {"DataType=6\n", "t.eds:1: DataType=6: stands before every section"},
      {"[1017\n", "t.eds:1: [1017: is a section without its ]"},
      {"[1017]\nnonsense\n", "t.eds:2: nonsense: is neither"},
      {good + Variable("1017", kU16, "rw"),
       "t.eds:7: [1017]: occurs twice; the first is in line 1"},
      {good + "[6040SUB1]\nAccessType=rw\naccesstype=ro\n",
       "t.eds:9: accesstype: occurs twice; the first is in line 8"},
      {"[1017]\nAccessType=rw\n", "t.eds:1: DataType: is missing"},
      {"[1017]\nDataType=6\n", "t.eds:1: AccessType: is missing"},
      {"[1017]\nDataType=6\nAccessType=all\n", "t.eds:3: AccessType: is 'all'; allowed: ro, wo"},
      {"[1017]\nDataType=six\nAccessType=rw\n", "t.eds:2: DataType: is 'six'"},
      {good + "[OptionalObjects]\nSupportedObjects=1\n1=0x1018\n",
       "t.eds:9: 1: lists 1018h, which has no section"},
      {good + "[OptionalObjects]\nSupportedObjects=65535\n1=0x1017\n", "t.eds:7: 2: is missing"},
      {good + "[1018]\nDataType=7\nAccessType=rw\nCompactSubObj=255\n", "CompactSubObj: is '255'"},
      {"[1017]\nDataType=\x01\x02" + std::string(100'000, 'a') + "\nAccessType=rw\n",
       "t.eds:2: DataType: is '??aaaa"}};
  for (const Case& hostile : cases) {
    try {
      static_cast<void>(ElectronicDataSheet::Parse(hostile.text, "t.eds", 1));
      ADD_FAILURE() << hostile.fragment << ": was accepted";
    } catch (const FileError& error) {
      EXPECT_THAT(error.what(), HasSubstr(hostile.fragment));
      EXPECT_LT(std::string(error.what()).size(), 300U);
    }
  }
}

TEST(Eds, AHugeFileIsReadInTimeThatGrowsWithItsLength) {
  std::string text;
  for (int index = 0x2000; index < 0x6000; ++index)
    text += Variable(fmt::format("{:x}", index), kU16, "rw");
  text += Variable("1017", kU16, "rw") + ";" + std::string(1 << 20, ';') + "\n";
  EXPECT_EQ(ObjectOf(text).bits, 16);
  // A file that is no sheet at all ends before memory does.
  const testing::TemporaryFolder folder;
  testing::WriteFile(folder / "huge.eds", std::string(kLargestFile + 1, 'x'));
  EXPECT_THROW(static_cast<void>(ReadTextFile(folder / "huge.eds")), FileError);
}

TEST(Eds, AFileThatIsMissingIsNamed) {
  const std::string shipped =
      testing::ReadFile(testing::SourcePath("primitives/robots/tumbler_drives_cia402.toml"));
  try {
    static_cast<void>(ParseDrives(With(shipped, "protocol = \"canopen-csp\"",
                                       "protocol = \"canopen-csp\"\neds = \"none.eds\""),
                                  "/nonexistent/d.toml"));
    FAIL() << "was accepted";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/nonexistent/none.eds"));
  }
}

}  // namespace
}  // namespace tumbler
