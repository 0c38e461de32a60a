# cmake -DHEADERS=FOLDER -DOUTPUT=FILE -P write_interface.cmake: FILE defines FAULTLINE_INTERFACE as a symbol whose name
# is a hash of all headers in FOLDER/faultline. libfaultline defines that symbol; a library of a rig refers to it, so that one
# that was compiled with other headers is not loaded (src/faultline/rig/rig_library.h).
file(GLOB_RECURSE headers RELATIVE ${HEADERS} ${HEADERS}/faultline/*.h)
list(SORT headers)
set(hashes "")
foreach(header ${headers})
  file(MD5 ${HEADERS}/${header} hash)
  string(APPEND hashes "${header} ${hash}\n")
endforeach()
string(MD5 all "${hashes}")
file(WRITE ${OUTPUT} "#pragma once\n#define FAULTLINE_INTERFACE faultline_interface_${all}\n")
