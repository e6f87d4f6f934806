# cmake -DFOLDER=page -DPAGE=page.html -DFUNCTION=ReportPage -DOUTPUT=report_page.cc -P embed_page.cmake
#
# Puts every part that the page names as {{FILE}} into it, and the page into a C++ source, as bytes: a
# string literal of this length is beyond what compilers must take.
file(READ ${FOLDER}/${PAGE} page)
string(REGEX MATCHALL "{{[a-z_]+\\.(css|html|js)}}" places "${page}")
foreach(place ${places})
  string(REGEX REPLACE "[{}]" "" part "${place}")
  file(READ ${FOLDER}/${part} text)
  string(REPLACE "${place}" "${text}" page "${page}")
endforeach()
file(WRITE ${OUTPUT}.html "${page}")
file(READ ${OUTPUT}.html bytes HEX)
file(REMOVE ${OUTPUT}.html)
string(REGEX REPLACE "(................................)" "\\1\n" bytes "${bytes}")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
file(WRITE ${OUTPUT} "// Made by offline/pages/embed_page.cmake.
#include \"offline/pages/report_page.h\"

namespace tumbler {
namespace {
constexpr unsigned char k${FUNCTION}[] = {
${bytes}
};
}  // namespace

std::string ${FUNCTION}() { return {std::begin(k${FUNCTION}), std::end(k${FUNCTION})}; }

}  // namespace tumbler
")
