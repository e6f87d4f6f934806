# cmake -DFOLDER=page -DOUTPUT=report_page.cc -P embed_page.cmake
#
# Puts the style and the scripts of the report into its page and the page into a C++ source, as bytes: a string
# literal of this length is beyond what compilers must take.
file(READ ${FOLDER}/page.html page)
foreach(part page.css motion.js robot.js plot.js page.js)
  file(READ ${FOLDER}/${part} text)
  string(FIND "${page}" "{{${part}}}" found)
  if(found EQUAL -1)
    message(FATAL_ERROR "${FOLDER}/page.html: no place for {{${part}}}")
  endif()
  string(REPLACE "{{${part}}}" "${text}" page "${page}")
endforeach()
file(WRITE ${OUTPUT}.html "${page}")
file(READ ${OUTPUT}.html bytes HEX)
file(REMOVE ${OUTPUT}.html)
string(REGEX REPLACE "(................................)" "\\1\n" bytes "${bytes}")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
file(WRITE ${OUTPUT} "// Made by offline/report/embed_page.cmake.
#include \"offline/report/report_page.h\"

namespace tumbler {
namespace {
constexpr unsigned char kBytes[] = {
${bytes}
};
}  // namespace

std::string ReportPage() { return {std::begin(kBytes), std::end(kBytes)}; }

}  // namespace tumbler
")
