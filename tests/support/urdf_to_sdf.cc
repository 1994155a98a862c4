// Convert URDF files to SDF with Debian's libsdformat: each argument x.urdf is written as SDF beside it, as x.sdf.
#include <fstream>
#include <iostream>
#include <string>

#include <sdf/parser.hh>

int main(int count, char **words)
{
  for (int i = 1; i < count; ++i)
  {
    const std::string file = words[i];
    sdf::SDFPtr document(new sdf::SDF());
    sdf::init(document);
    sdf::Errors errors;
    const bool read = sdf::readFile(file, document, errors);
    for (const auto &error : errors)
      std::cerr << file << ": " << error << std::endl;
    if (!read || !errors.empty())
      return 1;
    std::ofstream(file.substr(0, file.rfind('.')) + ".sdf") << document->ToString();
  }
  return 0;
}
