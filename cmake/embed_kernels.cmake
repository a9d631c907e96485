# Writes the source file OUTPUT. Its function kernel_files() returns the name and the text of each file of KERNELS in FOLDER, in order.
set(text "// Made from kernels/ by cmake/embed_kernels.cmake.\n#include \"opencl/kernel_files.hpp\"\n\nnamespace frontier_surfels {\n
const std::vector<KernelFile>& kernel_files() {\n  static const std::vector<KernelFile> files = {\n")
foreach(file ${KERNELS})
  file(READ "${FOLDER}/${file}" content)
  string(APPEND text "      {\"${file}\",\n       R\"KERNEL(${content})KERNEL\"},\n")
endforeach()
string(APPEND text "  };\n  return files;\n}\n\n}  // namespace frontier_surfels\n")
file(WRITE "${OUTPUT}" "${text}")
