#!/bin/sh
# Brings the JavaScript libraries of the reports anew: three.js, bundled to what replay.js takes of
# it, and uPlot. Needs npm; the results are part of the package, so that nobody else does.
set -eu
assets=$(cd "$(dirname -- "$0")/../spacerobot_ros/report/assets" && pwd)
three=0.187.0 uplot=1.6.32 esbuild=0.28.2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm install --silent "three@$three" "uplot@$uplot" "esbuild@$esbuild"
cat > entry.js <<'END'
export {
  Box3, BoxGeometry, BufferAttribute, BufferGeometry, Color, CylinderGeometry, DirectionalLight,
  DoubleSide, GridHelper, Group, HemisphereLight, Mesh, MeshLambertMaterial, PerspectiveCamera,
  Scene, SphereGeometry, Vector3, WebGLRenderer,
} from 'three';
export { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
END
npx esbuild entry.js --bundle --minify --format=iife --global-name=THREE --outfile=three.js
{
    echo "/* three.js $three, MIT; see LICENSES.txt. Made by scripts/vendor_js.sh. */"
    cat three.js
} > "$assets/three.min.js"
cp node_modules/uplot/dist/uPlot.iife.min.js "$assets/uplot.min.js"
cp node_modules/uplot/dist/uPlot.min.css "$assets/uplot.min.css"
{
    echo "three.min.js: three.js $three (parts of it, with OrbitControls)"
    echo
    cat node_modules/three/LICENSE
    echo
    echo "uplot.min.js, uplot.min.css: uPlot $uplot"
    echo
    cat node_modules/uplot/LICENSE
} > "$assets/LICENSES.txt"
