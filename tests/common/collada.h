/* SPDX-License-Identifier: MIT */
/* A Collada file of one triangle, as a literal: COLLADA_TRIANGLE("0 0 0 1 0 0 0 1 0"). The numbers may be conversions of
 * printf. For tests of what Assimp reads, in single precision. */
#ifndef TESTS_COMMON_COLLADA_H
#define TESTS_COMMON_COLLADA_H

#define COLLADA_TRIANGLE(numbers)                                                                                \
    "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"  \
    "<asset><unit meter=\"1\"/><up_axis>Y_UP</up_axis></asset><library_geometries><geometry id=\"g\"><mesh>"     \
    "<source id=\"p\"><float_array id=\"pa\" count=\"9\">" numbers                                               \
    "</float_array><technique_common><accessor source=\"#pa\" count=\"3\" stride=\"3\">"                         \
    "<param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/>"     \
    "</accessor></technique_common></source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/>"     \
    "</vertices><triangles count=\"1\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 2</p>"      \
    "</triangles></mesh></geometry></library_geometries><library_visual_scenes><visual_scene id=\"s\">"          \
    "<node id=\"n\" name=\"hall\"><instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>" \
    "<scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>"

#endif
