# cmake -DINPUT=file -DOUTPUT=file.cc -P embed.cmake: the bytes of a file as an array in C++.
file(READ ${INPUT} bytes HEX)
string(LENGTH "${bytes}" digits)
math(EXPR size "${digits} / 2")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
string(REGEX REPLACE "(................................................................................)" "\\1\n"
       bytes "${bytes}")
file(WRITE ${OUTPUT} "#include <cstddef>
namespace adhesim {
extern const unsigned char kSceneDescriptors[];
extern const std::size_t kSceneDescriptorsSize;
const unsigned char kSceneDescriptors[] = {
${bytes}
};
const std::size_t kSceneDescriptorsSize = ${size};
}  // namespace adhesim
")
