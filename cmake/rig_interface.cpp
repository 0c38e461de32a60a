// Part of every library that faultline_add_rig() makes: a reference to the symbol that names the headers it was
// compiled with. Only a libfaultline of the same headers has that symbol; no other can load the library.
#include <faultline/interface.h>

extern "C" const int FAULTLINE_INTERFACE;

namespace {
[[gnu::used]] const int* const compiled_for = &FAULTLINE_INTERFACE;
}
