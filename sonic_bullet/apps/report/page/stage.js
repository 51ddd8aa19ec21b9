// What a page shows in 3D: light, a camera that turns about its target, and a picture drawn where something changed.

class Stage {
  constructor(canvas, view_deg, near_m) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(view_deg, 1, near_m, 1000);
    this.camera.up.set(0, 0, 1);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a929c, 1.9), this.camera);
    const lamp = new THREE.DirectionalLight(0xffffff, 1.2);
    lamp.position.set(0.5, 1, 1);
    this.camera.add(lamp);
    this.marker = new THREE.Mesh(new THREE.SphereGeometry(1, 16, 12), new THREE.MeshBasicMaterial({ color: 0xd7263d }));
    this.scene.add(this.marker);
  }

  // Lets the pointer turn the camera: after who wants to be asked first listens.
  orbit() {
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => { this.stale = true; });
    new ResizeObserver(() => this.fit()).observe(this.canvas);
  }

  mark(place) {
    this.marker.visible = place !== null;
    if (place) this.marker.position.set(...place);
    this.stale = true;
  }

  // Turns the camera by angles in radians: for keys and buttons.
  turn(around, up) {
    const way = this.camera.position.clone().sub(this.controls.target), far = way.length();
    const height = Math.min(Math.max(Math.asin(way.z / far) + up, -1.5), 1.5), angle = Math.atan2(way.y, way.x) + around;
    way.set(Math.cos(height) * Math.cos(angle), Math.cos(height) * Math.sin(angle), Math.sin(height)).multiplyScalar(far);
    this.camera.position.copy(this.controls.target).add(way);
    this.controls.update();
    this.stale = true;
  }

  fit() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.stale = true;
  }

  draw() {
    if (!this.stale) return;
    this.stale = false;
    this.renderer.render(this.scene, this.camera);
  }
}
