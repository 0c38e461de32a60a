// Rigs that are no part of this build: each is a package of its own, with a datasheet and a shared library of its
// equations (and whatever else it registers: controllers, effects), which is loaded when the rig is asked for.
//
// A package says in its package.xml what it brings, once per rig:
//
//     <export><faultline rig="NAME" library="libNAME.so" config="config/NAME"/></export>
//
// config: the folder of rig.yaml, below the package's folder; config/NAME where it is left out. library: a file name,
// looked for in the lib/ of the space that is given, of the package itself and of the spaces around it; ${prefix} in
// both is the package's folder.
//
// A folder in which rigs are looked for is one of
//   a package           holds package.xml
//   a devel space       holds .catkin, which names the source folders
//   an install space    holds share/PACKAGE/package.xml
//   a plain folder      holds config/RIG/rig.yaml and lib/libRIG.so
//
// What is wrong with one rig is kept as its trouble, so that it does not stop work on another; asking for that rig is
// an InputError. A library that was built against other headers of faultline than this build's is refused before any of
// its code runs, where faultline_add_rig() (cmake/) made it: it refers to a symbol whose name is a hash of all headers.
#pragma once

#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"

namespace faultline {

struct RigPlace {
  std::string rig;      // empty: a folder that holds none
  std::string config;   // folder of its rig.yaml
  std::string library;  // path
  std::string package;  // folder of the package, or the plain folder
  std::string trouble;  // one line: what is wrong and what to do; empty: nothing is known to be
};

// All rigs in these folders. `spaces`: further folders with a lib/, where libraries may be.
std::vector<RigPlace> find_rig_places(const std::vector<std::string>& folders, const std::vector<std::string>& spaces);

// Loads the library, once; it stays loaded. InputError if that fails, or if there is trouble.
void load_rig(const RigPlace& place);

// The library of `rig`, where one of `places` has it and this build does not; else nothing.
void load_rig(const std::vector<RigPlace>& places, const std::string& rig);

// The datasheet of `rig`: of this build (folder `own` holds RIG/rig.yaml), or of one of `places`, whose library is then
// loaded. InputError if there is none, or two.
Datasheet find_datasheet(const std::string& own, const std::vector<RigPlace>& places, const std::string& rig);

// read_datasheet() of a path, with the library of the rig that it is of.
Datasheet read_datasheet(const std::string& path, const std::vector<RigPlace>& places);

}  // namespace faultline
