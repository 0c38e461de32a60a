// Processors that this process may run on: where it is bound to some of them, fewer than the machine has.
#pragma once

namespace faultline {

int usable_cores();  // at least 1

}  // namespace faultline
