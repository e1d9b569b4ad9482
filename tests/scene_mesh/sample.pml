<?xml version="1.0" encoding="UTF-8"?>
<!-- Written by hand: every element of the subset of PML 0.6 that docs/pml.md describes. -->
<physicalModel name="pyramid &amp; co" nrOfAtoms="99" nrOfExclusiveComponents="1" nrOfInformativeComponents="4" nrOfCells="15" author="nobody">
<atoms>
<structuralComponent name="element list" mode="POINTS">
<color r="0.5" g="0.5" b="0.8" a="1"/>
<nrOfStructures value="35"/> <!-- counts in circulation are wrong; nobody needs them -->
<atom><atomProperties index="13" x="0" y="1" z="-0" mass="0.25"/></atom>
<atom><atomProperties index="10" x="0" y="0" z="0" name="corner" mass="0.25" fixed="true"/></atom>
<atom><atomProperties index="11" x="1" y="0.0" z="0"/></atom>
<atom><atomProperties index="12" x="1e0" y=" 1 " z="0"/></atom>
<atom><atomProperties index="20" x="0.5" y="0.5" z="0.1"/></atom>
<atom><atomProperties index="100" x="3" y="0" z="0"/></atom>
<atom><atomProperties index="101" x="4" y="0" z="0"/></atom>
<atom><atomProperties index="102" x="4" y="1" z="0"/></atom>
<atom><atomProperties index="103" x="3" y="1" z="0"/></atom>
<atom><atomProperties index="104" x="3" y="0" z="1"/></atom>
<atom><atomProperties index="105" x="4" y="0" z="1"/></atom>
<atom><atomProperties index="106" x="4" y="1" z="1"/></atom>
<atom><atomProperties index="107" x="3" y="1" z="1"/></atom>
<atom><atomProperties index="108" x="3.5" y="0.5" z="2"/></atom>
<atom><atomProperties index="109" x="3.5" y="0.5" z="1.5"/></atom>
<atom><atomProperties index="110" x="3" y="-1" z="0"/></atom>
<atom><atomProperties index="111" x="4" y="-1" z="0"/></atom>
</structuralComponent>
</atoms>
<exclusiveComponents>
<multiComponent name="Exclusive Components" note="kept">
<multiComponent name="Bodies">
<structuralComponent name="empty"/>
<structuralComponent name="thread">
<cell><cellProperties type="LINE"/><atomRef index="10"/><atomRef index="20"/></cell>
<cell><cellProperties type="POLY_LINE"/><atomRef index="10"/><atomRef index="20"/><atomRef index="12"/></cell>
</structuralComponent>
<structuralComponent name="skin" mode="WIREFRAME_AND_SURFACE" young="100">
<color r="1" g="0" b="0" a="1"/>
<nrOfStructures value="5"/>
<cell>
<cellProperties index="0" type="QUAD" name="base" stiff="yes"/>
<color r="0" g="1" b="0" a="0.5"/>
<nrOfStructures value="4"/>
<atomRef index="10"/><atomRef index="13"/><atomRef index="12"/><atomRef index="11"/>
</cell>
<cell><cellProperties index="1" type="TRIANGLE"/><atomRef index="10"/><atomRef index="11"/><atomRef index="20"/></cell>
<cell><cellProperties index="2" type="TRIANGLE"/><atomRef index="11"/><atomRef index="12"/><atomRef index="20"/></cell>
<cell><cellProperties index="3" type="TRIANGLE"/><atomRef index="12"/><atomRef index="13"/><atomRef index="20"/></cell>
<cell><cellProperties index="7" type="TRIANGLE"/><atomRef index="13"/><atomRef index="10"/><atomRef index="20"/></cell>
</structuralComponent>
<!-- A cube, a wedge on its front and a pyramid of two tetrahedra on each of two triangles of its top. -->
<structuralComponent name="solid">
<cell>
<cellProperties type="HEXAHEDRON"/>
<atomRef index="100"/><atomRef index="101"/><atomRef index="102"/><atomRef index="103"/>
<atomRef index="104"/><atomRef index="105"/><atomRef index="106"/><atomRef index="107"/>
</cell>
<cell>
<cellProperties type="WEDGE"/>
<atomRef index="110"/><atomRef index="104"/><atomRef index="100"/>
<atomRef index="111"/><atomRef index="105"/><atomRef index="101"/>
</cell>
</structuralComponent>
<structuralComponent name="spire">
<cell><cellProperties type="TETRAHEDRON"/><atomRef index="108"/><atomRef index="104"/><atomRef index="105"/><atomRef index="109"/></cell>
<cell><cellProperties type="TETRAHEDRON"/><atomRef index="105"/><atomRef index="108"/><atomRef index="106"/><atomRef index="109"/></cell>
<cell><cellProperties type="TETRAHEDRON"/><atomRef index="106"/><atomRef index="107"/><atomRef index="108"/><atomRef index="109"/></cell>
<cell><cellProperties type="TETRAHEDRON"/><atomRef index="107"/><atomRef index="104"/><atomRef index="108"/><atomRef index="109"/></cell>
</structuralComponent>
</multiComponent>
</multiComponent>
</exclusiveComponents>
<informativeComponents>
<multiComponent name="Informative Components">
<structuralComponent name="Neighborhoods">
<cell>
<cellProperties index="8" type="POLY_VERTEX" name="Atom #20"/>
<nrOfStructures value="5"/>
<atomRef index="20"/><atomRef index="10"/><atomRef index="11"/><atomRef index="12"/><atomRef index="13"/>
</cell>
</structuralComponent>
<structuralComponent name="fixed">
<atomRef index="10"/>
<atomRef index="11"/>
</structuralComponent>
<structuralComponent name="front">
<cellRef index="1"/>
<cellRef index="2"/>
</structuralComponent>
</multiComponent>
</informativeComponents>
</physicalModel>
