#pragma once

#include <cstddef>
#include <string_view>

namespace tumbler {

/// The tag of an element in a text.
struct XmlTag {
  std::size_t begin = 0, end = 0;  ///< Of `<` and behind `>`; the text's end where there is none.
  std::string_view name;
  bool opens = false, closes = false;  ///< Both: the element is this tag alone.
};

/// Goes through the tags of a text of XML, past comments, CDATA and declarations. The text need not
/// be well-formed.
class XmlTags {
 public:
  explicit XmlTags(std::string_view text) : text_(text) {}

  /// Moves on to the next tag. @returns false where there is none.
  bool Next(XmlTag& tag) {
    for (at_ = text_.find('<', at_); at_ < text_.size(); at_ = text_.find('<', at_)) {
      const std::string_view rest = text_.substr(at_);
      if (rest.starts_with("<!--")) {
        at_ = Past(at_ + 4, "-->");
      } else if (rest.starts_with("<![CDATA[")) {
        at_ = Past(at_, "]]>");
      } else if (rest.starts_with("</")) {
        tag = {at_, Past(at_, ">"), NameAt(at_ + 2), false, true};
        at_ = tag.end;
        return true;
      } else if (rest.size() < 2 || !StartsName(rest[1])) {
        at_ = Past(at_, ">");
      } else {
        tag = {at_, EndOfTag(at_ + 1), NameAt(at_ + 1), true, false};
        tag.closes = tag.end >= 2 && text_.substr(tag.end - 2, 2) == "/>";
        at_ = tag.end;
        return true;
      }
    }
    return false;
  }

 private:
  static bool StartsName(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' ||
           static_cast<unsigned char>(c) >= 127;
  }

  [[nodiscard]] std::size_t Past(std::size_t from, std::string_view end) const {
    const std::size_t found = text_.find(end, from);
    return found == std::string_view::npos ? text_.size() : found + end.size();
  }

  [[nodiscard]] std::string_view NameAt(std::size_t begin) const {
    const std::string_view rest = text_.substr(begin);
    return rest.substr(0, rest.find_first_of(" \t\r\n/>"));
  }

  /// Behind the `>` that is in no attribute.
  [[nodiscard]] std::size_t EndOfTag(std::size_t i) const {
    char quote = 0;
    for (; i < text_.size() && (quote != 0 || text_[i] != '>'); ++i) {
      if (quote == 0 && (text_[i] == '"' || text_[i] == '\'')) {
        quote = text_[i];
      } else if (text_[i] == quote) {
        quote = 0;
      }
    }
    return i < text_.size() ? i + 1 : i;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

}  // namespace tumbler
